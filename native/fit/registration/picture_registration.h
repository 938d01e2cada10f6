#pragma once

#include "fit/registration/registration.h"

namespace stipple {

class BackendFactory;
class ViewSource;

/// Gives a template the shape that images show, by what a renderer of meshes with derivatives makes
/// of it, or of splats bound to it: the outlines of all images, and the shades of one light on a
/// surface of one colour. In: as registerMesh() has it, with views as the target: images with alpha
/// or masks; backends, who draw the splats of PictureDrawing::kSplats. Options:
/// weights and samples have no part; alignment kNone or kSize, which gives the template the middle
/// and the size that the masks have together. The report measures images, not distances.
/// Errors: kInvalidArgument also for landmarks, other alignments, and what targetPictures()
/// refuses; kCancelled. Threads and determinism: parallel; same result for any number of threads.
RegisteredMesh registerToPictures(const TriMesh& given, const ViewSource& views,
                                  const RegistrationOptions& options,
                                  const BackendFactory& backends, Progress* progress = nullptr,
                                  RegistrationWatch* watch = nullptr);

/// Bytes at most, beside those that loading one image takes.
uint64_t pictureRegistrationMemoryBound(const TriMesh& given, const ViewSource& views,
                                        const RegistrationOptions& options,
                                        const BackendFactory& backends);

}  // namespace stipple
