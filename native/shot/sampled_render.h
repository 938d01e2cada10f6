#pragma once

#include <functional>
#include <span>
#include <vector>

#include "shot/aperture.h"
#include "shot/shutter.h"
#include "splat/render/render.h"

namespace stipple {

/// Light that comes through the whole lens while the shutter is open, to the whole pixel.
struct Sampling {
  Aperture aperture;
  Shutter shutter;
  /// Pictures that are averaged. 0: one where nothing is blurred, else as automaticSamples says.
  /// 1: the middle of lens and time alone.
  uint32_t samples = 0;
};

constexpr uint32_t kMaxSamples = 1 << 16;

/// Whether more than one picture is needed, or one at another moment.
bool isSampled(const Sampling& sampling);

/// Refuses more than kMaxSamples, an aperture outside its range, and what validate(Shutter)
/// refuses. Errors: kInvalidArgument.
void validate(const Sampling& sampling, std::span<const SplatInstance> instances);

/// A power of two from 16 to 256: enough that the copies of a splat in the picture lie at most two
/// pixels apart where the lens spreads it, and one where it moves, by the matrices or by a motion
/// of its own, for 19 of 20 splats. What else changes of a splat (shape, opacity, colour) asks for
/// no more. Cost: at most 2048 splats are looked at.
uint32_t automaticSamples(std::span<const SplatInstance> instances, const Camera& camera,
                          const Sampling& sampling);

/// Draws one picture by any renderer, its colours as light: what may be added up. In: options, with
/// the point of the lens.
using DrawMoment =
    std::function<void(std::span<const SplatInstance> instances, const Camera& camera,
                       const RenderOptions& options, RenderResult& result, Progress* progress)>;

/// Averages pictures from points of the lens, moments and places in the pixel, spread by
/// scrambledSobol in the order lens, time, pixel as far as each is on. Premultiplied colour, the
/// weight before a surface and transmittance are averaged, in double; depths, counts, normals and
/// objects are those of one more picture from the middle of all. A surface takes part in every
/// picture as it is: whoever hands it in has blurred it already. Splats that change are drawn as
/// they are at each moment: an instance's cloud may then lie where another one lay in the picture
/// before.
/// Lens: with an image plane, the camera is moved across its axis and its picture shifted so that
/// the plane of focus stands still (orthographic: space is sheared); else rays start across each
/// of them. Same bits for any number of threads if the renderer's are. Cost: that of as many
/// pictures. Memory: renderSampledBytes beside the renderer's own.
/// Errors: validate(Sampling), values of clouds of the shutter that validate(SplatCloud) refuses;
/// the renderer's. Based on: Haeberli and Akeley, The Accumulation Buffer, SIGGRAPH 1990.
void renderSampled(std::span<const SplatInstance> instances, const Camera& camera,
                   const RenderOptions& options, const Sampling& sampling, const DrawMoment& draw,
                   RenderResult& result, Progress* progress = nullptr);

/// Bytes that renderSampled allocates at most, its result included and the renderer's not.
uint64_t renderSampledBytes(std::span<const SplatInstance> instances, const Camera& camera,
                            const RenderOptions& options, const Sampling& sampling);

}  // namespace stipple
