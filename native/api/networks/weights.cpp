#include <memory>

#include "api/guard.h"
#include "api/handles.h"
#include "api/job.h"
#include "api/networks/weights_folder_of.h"
#include "io/assets/weight_file.h"

using namespace stipple;
using namespace stipple::api;

namespace {

StippleWeightsFile fileTo(const WeightsFolder& folder, WeightsRole role) {
  const WeightsFile& file = folder.of(role);
  const PublishedWeights& published = publishedWeights()[static_cast<size_t>(role)];
  StippleWeightsFile out = {};
  out.role = static_cast<uint32_t>(published.role);
  out.state = static_cast<uint32_t>(stateOf(folder, role));
  out.bytes = file.bytes;
  out.published_bytes = published.bytes;
  out.modified_ns = file.modified;
  out.label_utf8 = published.label;
  out.path_utf8 = file.path.c_str();
  out.published_path_utf8 = published.path;
  out.published_sha256_utf8 = published.sha256;
  out.sha256_utf8 = file.sha256.c_str();
  out.licence_utf8 = published.licence;
  return out;
}

}  // namespace

namespace stipple::api {

std::string weightsFolderOf(const StippleContext& context, const char* given, const char* name) {
  std::string folder = given != nullptr ? given : context.state->weights->folder();
  if (given == nullptr && folder.empty()) folder = context.state->weights->shipped();
  if (folder.empty()) {
    fail(ErrorCode::kInvalidArgument, std::string(name) +
                                          " names no weights folder, and the context has none; " +
                                          publishedWeightsSource());
  }
  return folder;
}

}  // namespace stipple::api

extern "C" {

StippleStatus stipple_weights_find(StippleContext* context, const char* folder_utf8,
                                   StippleWeights** weights) {
  return guarded([&] {
    require(context, "context");
    require(weights, "weights");
    const std::string folder = weightsFolderOf(*context, folder_utf8, "folder_utf8");
    *weights = new StippleWeights{context->state,
                                  std::make_shared<const WeightsFolder>(findWeights(folder))};
  });
}

StippleStatus stipple_weights_save_half_sized(const char* weights_path, const char* out_path) {
  return guarded([&] {
    require(weights_path, "weights_path");
    require(out_path, "out_path");
    writeHalfSizedWeights(weights_path, out_path);
  });
}

void stipple_weights_free(StippleWeights* weights) {
  delete weights;
}

StippleStatus stipple_weights_info(const StippleWeights* weights, StippleWeightsInfo* info) {
  return guarded([&] {
    const WeightsFolder& folder = *require(weights, "weights").folder;
    StippleWeightsInfo out = {};
    out.file_count = static_cast<uint32_t>(kWeightsRoleCount);
    out.note_count = folder.notes.size();
    out.folder_utf8 = folder.path.c_str();
    out.source_utf8 = publishedWeightsSource();
    deliver(info, out, "info");
  });
}

StippleStatus stipple_weights_file(const StippleWeights* weights, uint32_t role,
                                   StippleWeightsFile* file) {
  return guarded([&] {
    const WeightsFolder& folder = *require(weights, "weights").folder;
    const auto wanted = enumValue<WeightsRole>(role, kWeightsRoleCount - 1, "role");
    deliver(file, fileTo(folder, wanted), "file");
  });
}

StippleStatus stipple_weights_note(const StippleWeights* weights, uint64_t index,
                                   const char** text_utf8) {
  return guarded([&] {
    const std::vector<std::string>& notes = require(weights, "weights").folder->notes;
    require(text_utf8, "text_utf8");
    if (index >= notes.size()) {
      fail(ErrorCode::kInvalidArgument, "index is " + std::to_string(index) + "; there are " +
                                            std::to_string(notes.size()) + " notes");
    }
    *text_utf8 = notes[static_cast<size_t>(index)].c_str();
  });
}

StippleStatus stipple_weights_check_start(const StippleWeights* weights, StippleJob** job) {
  return guarded([&] {
    require(job, "job");
    const std::shared_ptr<const WeightsFolder> folder = require(weights, "weights").folder;
    *job = startJob(weights->context, [folder](Progress& progress) -> JobResult {
      WeightsFolder hashed = *folder;
      hashWeights(hashed, &progress);
      return std::make_shared<const WeightsFolder>(std::move(hashed));
    });
  });
}

StippleStatus stipple_job_weights(const StippleJob* job, StippleWeights** weights) {
  return guarded([&] {
    const auto& made =
        jobResult<std::shared_ptr<const WeightsFolder>>(require(job, "job"), "table of weights");
    require(weights, "weights") = new StippleWeights{job->context, made};
  });
}

}  // extern "C"
