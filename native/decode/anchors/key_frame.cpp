// Based on: Kwak et al., MoRel, CVPR 2026 (arXiv 2512.09270): key-frame anchors, deformation in
// both directions, temporal opacity. Differs: docs/methods/relay.md.
#include "decode/anchors/key_frame.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/number_text.h"

namespace stipple {

namespace {

/// How fast anchors fade: with it, a key frame at its own moment has 98 % of itself.
constexpr double kFading = 4;
constexpr uint32_t kMostFrames = uint32_t{1} << 24;

double logistic(double x) {
  const double e = std::exp(-std::abs(x));
  return x < 0 ? e / (1 + e) : 1 / (1 + e);
}

double softplus(double x) {
  return x > 30 ? x : std::log1p(std::exp(x));
}

/// How far a time is from where an anchor is whole, and its derivative by the offset.
struct Apart {
  double distance;
  double by_offset;
};

Apart apartOf(double tau, double offset, KeyFrameBlend blend) {
  if (blend == KeyFrameBlend::kPlateau) {
    const double apart = std::abs(tau) - std::abs(offset);
    // An offset of 0 learns, too: it grows in the direction of the time.
    const bool is_forward = offset == 0 ? tau >= 0 : offset > 0;
    return apart > 0 ? Apart{apart, is_forward ? -1.0 : 1.0} : Apart{0, 0};
  }
  const double apart = tau - offset;
  return {std::abs(apart), apart > 0 ? -1.0 : apart < 0 ? 1.0 : 0.0};
}

/// From the first key frame to the last are so many frames less than from the first frame to the
/// last.
uint32_t framesBesideKeys(const KeyFrameClip& clip) {
  return clip.frame_count - 1 - (clip.keyCount() - 1) * clip.spacing;
}

}  // namespace

uint32_t KeyFrameClip::keyCount() const {
  return std::max<uint32_t>(1, (frame_count - 1 + spacing - 1) / spacing);
}

uint32_t firstKeyOf(const KeyFrameClip& clip) {
  return framesBesideKeys(clip) / 2;
}

void validate(const KeyFrameClip& clip) {
  if (std::isfinite(clip.begin) && std::isfinite(clip.frames_per_second) &&
      clip.frames_per_second > 0 && clip.frame_count >= 1 && clip.frame_count <= kMostFrames &&
      clip.spacing >= 1 && std::isfinite(clip.end()) && clip.blend <= KeyFrameBlend::kPlateau &&
      clip.first_key <= framesBesideKeys(clip)) {
    return;
  }
  fail(ErrorCode::kInvalidArgument,
       "the clip has " + std::to_string(clip.frame_count) + " frames at " +
           numberText(clip.frames_per_second) + " a second from " + numberText(clip.begin) +
           " s and a key frame every " + std::to_string(clip.spacing) + " from frame " +
           std::to_string(clip.first_key) +
           " on; 1 to 16777216 frames, a rate above 0, at least 1 frame between and all key frames "
           "within the clip are needed");
}

uint64_t mostAnchors(const KeyFrameClip& clip, std::span<const uint64_t> counts) {
  uint64_t most = 0;
  for (size_t n = 0; n < counts.size(); ++n) {
    const bool is_pair = n + 1 < counts.size() && clip.blend != KeyFrameBlend::kNone;
    most = std::max(most, is_pair ? 2 * std::max(counts[n], counts[n + 1]) : counts[n]);
  }
  return most;
}

KeyFramesAt keyFramesAt(const KeyFrameClip& clip, double seconds) {
  const double last = clip.frame_count - 1;
  const double held = std::clamp(seconds, clip.begin, std::max(clip.begin, clip.end()));
  const double frame = std::clamp((held - clip.begin) * clip.frames_per_second, 0.0, last);
  const uint32_t keys = clip.keyCount();
  KeyFramesAt at;
  const double apart = (frame - clip.first_key) / clip.spacing;
  at.key = std::min(static_cast<uint32_t>(std::max(0.0, apart)), keys - 1);
  at.has_next = apart >= 0 && at.key + 1 < keys;
  at.tau = apart - at.key;
  return at;
}

uint64_t KeyFrame::bytes() const {
  return scaffold.bytes() + (deformation.isThere() ? deformation.bytes() : 0) +
         blend.size() * sizeof(float);
}

std::vector<float> fadingOf(const KeyFrame& frame, size_t count, double tau, KeyFrameBlend blend) {
  std::vector<float> fading(count);
  const size_t at = tau < 0 ? 2 : 0;
  for (size_t a = 0; a < count; ++a) {
    const float* numbers = &frame.blend[a * kBlendNumbers + at];
    const double apart = apartOf(tau, static_cast<double>(numbers[0]), blend).distance;
    fading[a] =
        static_cast<float>(std::exp(-kFading * softplus(static_cast<double>(numbers[1])) * apart));
  }
  return fading;
}

std::vector<float> sharesOf(const std::vector<float>& own, const std::vector<float>& other) {
  double mean = 0;
  for (const float value : other) mean += static_cast<double>(value);
  mean /= static_cast<double>(std::max<size_t>(1, other.size()));
  std::vector<float> shares(own.size());
  for (size_t a = 0; a < own.size(); ++a) {
    const double sum = static_cast<double>(own[a]) + mean;
    // Where both have faded to nothing they share alike.
    shares[a] = static_cast<float>(sum > 1e-30 ? static_cast<double>(own[a]) / sum : 0.5);
  }
  return shares;
}

void sharesBackward(const std::vector<float>& own, const std::vector<float>& other,
                    const std::vector<float>& by_shares, std::vector<float>& by_own,
                    std::vector<float>& by_other) {
  double mean = 0;
  for (const float value : other) mean += static_cast<double>(value);
  const double count = static_cast<double>(std::max<size_t>(1, other.size()));
  mean /= count;
  double by_mean = 0;
  for (size_t a = 0; a < own.size(); ++a) {
    const double w = static_cast<double>(own[a]);
    const double sum = w + mean;
    if (!(sum > 1e-30)) continue;
    const double by = static_cast<double>(by_shares[a]) / (sum * sum);
    by_own[a] += static_cast<float>(by * mean);
    by_mean -= by * w;
  }
  for (float& by : by_other) by += static_cast<float>(by_mean / count);
}

void fadingBackward(const KeyFrame& frame, double tau, const std::vector<float>& by_fading,
                    std::vector<float>& by_blend, KeyFrameBlend blend) {
  const std::vector<float> fading = fadingOf(frame, by_fading.size(), tau, blend);
  const size_t at = tau < 0 ? 2 : 0;
  for (size_t a = 0; a < by_fading.size(); ++a) {
    const float* numbers = &frame.blend[a * kBlendNumbers + at];
    const double raw = static_cast<double>(numbers[1]);
    const Apart apart = apartOf(tau, static_cast<double>(numbers[0]), blend);
    const double by = static_cast<double>(by_fading[a]) * static_cast<double>(fading[a]) * kFading;
    by_blend[a * kBlendNumbers + at] -= static_cast<float>(by * softplus(raw) * apart.by_offset);
    by_blend[a * kBlendNumbers + at + 1] -= static_cast<float>(by * apart.distance * logistic(raw));
  }
}

void splatsOfKeyFrame(const KeyFrame& frame, size_t count, double tau, KeyFrameTape& tape,
                      SplatCloud& cloud) {
  // The scaffold outlives the call.
  const std::shared_ptr<const ScaffoldParameters> scaffold(std::shared_ptr<const void>(),
                                                           &frame.scaffold);
  const ScaffoldDecoder decoder(scaffold);
  if (!frame.deformation.isThere()) {
    decoder.forward(frame.scaffold, count, tape.splats, cloud);
    return;
  }
  deform(frame.deformation, frame.scaffold, count, tau, tape.deformation, tape.deformed);
  decoder.forward(tape.deformed, count, tape.splats, cloud);
}

void joinBlended(std::span<const SplatCloud> clouds, std::span<const KeyFrameTape> tapes,
                 std::span<const std::vector<float>> shares, uint32_t gaussians, SplatCloud& all) {
  for (size_t i = 0; i < clouds.size(); ++i) {
    const size_t first = i == 0 ? 0 : all.size();
    if (i == 0) {
      all = clouds[i];
    } else {
      for (const auto part : {&SplatCloud::positions, &SplatCloud::rotations, &SplatCloud::scales,
                              &SplatCloud::opacities, &SplatCloud::sh}) {
        (all.*part).insert((all.*part).end(), (clouds[i].*part).begin(), (clouds[i].*part).end());
      }
    }
    for (size_t n = 0; n < clouds[i].size() && !shares[i].empty(); ++n) {
      all.opacities[first + n] *= shares[i][tapes[i].splats.slots[n] / gaussians];
    }
  }
}

SplatCloud splatsOfClip(const KeyFrameClip& clip, const KeyFrameSource& frames, double seconds,
                        uint64_t budget) {
  const KeyFramesAt at = keyFramesAt(clip, seconds);
  struct Shown {
    std::shared_ptr<const KeyFrame> frame;
    double tau;
    size_t count;
  };
  std::vector<Shown> shown;
  const bool is_nearer = clip.blend != KeyFrameBlend::kNone || at.tau < 0.5 || !at.has_next;
  if (is_nearer) shown.push_back({frames(at.key), at.tau, 0});
  if (at.has_next && (clip.blend != KeyFrameBlend::kNone || !is_nearer)) {
    shown.push_back({frames(at.key + 1), at.tau - 1, 0});
  }
  for (Shown& one : shown) {
    const uint64_t all = one.frame->scaffold.size();
    one.count = static_cast<size_t>(
        budget == 0 ? all : std::min<uint64_t>(all, (budget + shown.size() - 1) / shown.size()));
  }
  std::vector<std::vector<float>> shares(shown.size());
  if (shown.size() == 2 && clip.blend == KeyFrameBlend::kLinear) {
    for (size_t i = 0; i < 2; ++i) {
      shares[i].assign(shown[i].count, static_cast<float>(1 - std::abs(shown[i].tau)));
    }
  } else if (shown.size() == 2) {
    const auto fadingOfShown = [&](const Shown& one) {
      return fadingOf(*one.frame, one.count, one.tau, clip.blend);
    };
    const std::vector<float> before = fadingOfShown(shown[0]), behind = fadingOfShown(shown[1]);
    shares[0] = sharesOf(before, behind);
    shares[1] = sharesOf(behind, before);
  }
  SplatCloud all;
  std::vector<KeyFrameTape> tapes(shown.size());
  std::vector<SplatCloud> clouds(shown.size());
  for (size_t i = 0; i < shown.size(); ++i) {
    splatsOfKeyFrame(*shown[i].frame, shown[i].count, shown[i].tau, tapes[i], clouds[i]);
  }
  joinBlended(clouds, tapes, shares, shown.front().frame->scaffold.gaussians, all);
  return all;
}

}  // namespace stipple
