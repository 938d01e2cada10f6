/* SPDX-License-Identifier: GPL-3.0-or-later
 * Loads the library by its path, as the add-on's binding does, and makes the calls that the add-on
 * makes of it: reads splats, makes a model of them, decodes it at a budget, renders, fills a
 * volume, writes. test_windows.py compiles it for Linux and for Windows and compares what comes
 * out.
 *
 *     library_driver LIBRARY FOLDER PIXELS
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <stipple/stipple.h>
#include <string.h>

#ifdef _WIN32
#include <windows.h>
/* After it. */
#include <shellapi.h>

static void* library;

static int loadLibrary(const char* path) {
  wchar_t wide[4096];
  MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, 4096);
  library = (void*)LoadLibraryW(wide);
  if (library == NULL) fprintf(stderr, "LoadLibraryW: error %lu\n", GetLastError());
  return library != NULL;
}

static void* functionOf(const char* name) {
  return (void*)GetProcAddress((HMODULE)library, name);
}

/* The words of the command line in UTF-8: what main() gets lacks most letters. */
static char** wordsOf(char** words) {
  int count = 0;
  wchar_t** wide = CommandLineToArgvW(GetCommandLineW(), &count);
  for (int i = 0; i < count; ++i) {
    words[i] = malloc(4096);
    WideCharToMultiByte(CP_UTF8, 0, wide[i], -1, words[i], 4096, NULL, NULL);
  }
  return words;
}
#else
#include <dlfcn.h>

static void* library;

static int loadLibrary(const char* path) {
  library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
  if (library == NULL) fprintf(stderr, "%s\n", dlerror());
  return library != NULL;
}

static void* functionOf(const char* name) {
  return dlsym(library, name);
}

static char** wordsOf(char** words) {
  return words;
}
#endif

static void* required(const char* name) {
  void* function = functionOf(name);
  if (function == NULL) {
    fprintf(stderr, "the library has no %s\n", name);
    exit(1);
  }
  return function;
}

/* The library's function of this name, with the type that the header gives it. */
#define CALL(name) ((__typeof__(&name))required(#name))

static void check(StippleStatus status) {
  if (status == STIPPLE_OK) return;
  fprintf(stderr, "%s\n", CALL(stipple_last_error_message)());
  exit(1);
}

static void finish(StippleJob* job) {
  check(CALL(stipple_job_wait)(job));
}

/* FOLDER/NAME; valid until the next call. */
static const char* inside(const char* folder, const char* name) {
  static char path[4096];
  snprintf(path, sizeof(path), "%s/%s", folder, name);
  return path;
}

static void save(const StippleCloud* cloud, const char* folder, const char* name) {
  check(CALL(stipple_cloud_save)(cloud, inside(folder, name), NULL));
}

static void sayError(StippleStatus status) {
  printf("%s: %s\n", CALL(stipple_status_name)(status), CALL(stipple_last_error_message)());
}

/* A model of the splats, saved, read again, and decoded at a budget. */
static StippleCloud* decoded(StippleContext* context, const StippleCloud* cloud,
                             const char* folder) {
  StippleModelFromCloudOptions options;
  CALL(stipple_model_from_cloud_options_init)(&options);
  StippleJob* job = NULL;
  check(CALL(stipple_model_from_cloud_start)(context, cloud, &options, &job));
  finish(job);
  StippleModel* model = NULL;
  check(CALL(stipple_job_model)(job, &model));
  CALL(stipple_job_free)(job);
  check(CALL(stipple_model_save)(model, inside(folder, "model.stipple.safetensors")));
  CALL(stipple_model_free)(model);
  check(CALL(stipple_model_load)(context, inside(folder, "model.stipple.safetensors"), &model));
  StippleDecodeOptions decode_options;
  CALL(stipple_decode_options_init)(&decode_options);
  decode_options.anchor_count = 150;
  StippleCloud* result = NULL;
  check(CALL(stipple_model_decode)(model, &decode_options, &result));
  CALL(stipple_model_free)(model);
  return result;
}

/* Steps of a fit to images of all splats. */
static StippleCloud* refined(const StippleCloud* cloud, const StippleCloud* full) {
  StippleRefineOptions options;
  CALL(stipple_refine_options_init)(&options);
  options.iterations = 20;
  options.view_count = 8;
  options.view_size = 96;
  StippleJob* job = NULL;
  check(CALL(stipple_cloud_refine_start)(cloud, full, &options, &job));
  finish(job);
  StippleCloud* result = NULL;
  check(CALL(stipple_job_cloud)(job, &result));
  CALL(stipple_job_free)(job);
  return result;
}

/* The splats where they are. */
static StippleInstance whole(const StippleCloud* cloud) {
  StippleInstance instance;
  memset(&instance, 0, sizeof(instance));
  instance.struct_size = sizeof(instance);
  instance.cloud = cloud;
  for (int i = 0; i < 4; ++i) instance.matrix[i * 5] = 1;
  return instance;
}

/* The pixels as PNG and as EXR, of which the second keeps every bit. */
static void writePictures(StippleContext* context, uint32_t width, uint32_t height,
                          const float* pixels, const char* folder) {
  StippleImage* image = NULL;
  check(CALL(stipple_image_create)(context, width, height, 4, STIPPLE_TRANSFER_LINEAR, pixels,
                                   &image));
  check(CALL(stipple_image_save)(image, inside(folder, "picture.png"), 0));
  check(CALL(stipple_image_save)(image, inside(folder, "picture.exr"), 0));
  CALL(stipple_image_free)(image);
  check(CALL(stipple_image_load)(context, inside(folder, "picture.exr"), &image));
  const size_t count = (size_t)width * height * 4;
  float* read = malloc(count * sizeof(float));
  check(CALL(stipple_image_read)(image, read, count));
  if (memcmp(read, pixels, count * sizeof(float)) != 0) {
    fprintf(stderr, "picture.exr holds other pixels than were written\n");
    exit(1);
  }
  free(read);
  CALL(stipple_image_free)(image);
}

/* A volume of the splats, which is written and read again. */
static void writeVolumes(StippleContext* context, const StippleCloud* cloud, const char* folder) {
  StippleInstance instance = whole(cloud);
  StippleVoxelizeOptions options;
  CALL(stipple_voxelize_options_init)(&options);
  options.resolution = 24;
  StippleJob* job = NULL;
  check(CALL(stipple_voxelize_start)(context, &instance, 1, &options, &job));
  finish(job);
  StippleVolume* volume = NULL;
  check(CALL(stipple_job_volume)(job, &volume));
  CALL(stipple_job_free)(job);
  StippleVolumeInfo first, second;
  memset(&first, 0, sizeof(first));
  first.struct_size = sizeof(first);
  second = first;
  check(CALL(stipple_volume_info)(volume, &first));
  check(CALL(stipple_volume_save)(volume, inside(folder, "volume.vdb")));
  CALL(stipple_volume_free)(volume);
  check(CALL(stipple_volume_load)(context, inside(folder, "volume.vdb"), &volume));
  check(CALL(stipple_volume_info)(volume, &second));
  CALL(stipple_volume_free)(volume);
  if (first.active_voxel_count < 100 || first.active_voxel_count != second.active_voxel_count) {
    fprintf(stderr, "volume.vdb holds other voxels than were written\n");
    exit(1);
  }
}

static void render(StippleContext* context, const StippleCloud* cloud, const char* folder,
                   const char* path) {
  StippleViews* views = NULL;
  check(CALL(stipple_views_load)(context, inside(folder, "transforms.json"), &views));
  StippleCamera camera;
  memset(&camera, 0, sizeof(camera));
  camera.struct_size = sizeof(camera);
  check(CALL(stipple_views_camera)(views, 0, &camera));
  StippleInstance instance = whole(cloud);
  StippleRenderOptions options;
  CALL(stipple_render_options_init)(&options);
  StippleRenderBuffers buffers;
  memset(&buffers, 0, sizeof(buffers));
  buffers.struct_size = sizeof(buffers);
  const size_t count = (size_t)camera.width * camera.height * 4;
  buffers.colour = malloc(count * sizeof(float));
  StippleRenderer* renderer = NULL;
  StippleJob* job = NULL;
  check(CALL(stipple_renderer_create)(context, &renderer));
  check(CALL(stipple_renderer_render_start)(renderer, &instance, 1, &camera, &options, &buffers,
                                            &job));
  finish(job);
  FILE* file = fopen(path, "wb");
  fwrite(buffers.colour, sizeof(float), count, file);
  fclose(file);
  writePictures(context, camera.width, camera.height, buffers.colour, folder);
  free(buffers.colour);
  CALL(stipple_job_free)(job);
  CALL(stipple_renderer_free)(renderer);
  CALL(stipple_views_free)(views);
}

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  char** words = wordsOf(argv);
  const char* folder = words[2];
  if (!loadLibrary(words[1])) return 1;
  if (CALL(stipple_abi_version)() != STIPPLE_ABI_VERSION) return 1;
  StippleContextOptions options;
  CALL(stipple_context_options_init)(&options);
  options.thread_count = 2;
  StippleContext* context = NULL;
  check(CALL(stipple_context_create)(&options, &context));

  StippleCloud* full = NULL;
  check(CALL(stipple_cloud_load)(context, inside(folder, "truth.ply"), &full));
  StippleCloud* part = decoded(context, full, folder);
  save(part, folder, "part.ply");
  save(part, folder, "part.ply"); /* over the one that is there */
  save(part, folder, "part.splat");
  save(part, folder, "part.compressed.ply");
  save(part, folder, "part.usda");
  save(part, folder, "part.glb");
  save(part, folder, "part.spz");
  save(part, folder, "part.sog");
  save(part, folder, "part.usdz");
  StippleCloud* again = NULL;
  check(CALL(stipple_cloud_load)(context, inside(folder, "part.spz"), &again));
  save(again, folder, "again.ply");
  StippleCloud* fitted = refined(part, full);
  save(fitted, folder, "fitted.ply");
  render(context, part, folder, words[3]);
  writeVolumes(context, part, folder);

  /* Errors are sentences that name the file, in UTF-8. */
  StippleCloud* none = NULL;
  sayError(CALL(stipple_cloud_load)(context, "nicht da \xc3\xa4.ply", &none));
  sayError(CALL(stipple_cloud_save)(part, inside(folder, "read only.ply"), NULL));
  StippleImage* image = NULL;
  sayError(CALL(stipple_image_load)(context, inside(folder, "truth.ply"), &image));

  CALL(stipple_cloud_free)(fitted);
  CALL(stipple_cloud_free)(again);
  CALL(stipple_cloud_free)(part);
  CALL(stipple_cloud_free)(full);
  CALL(stipple_context_free)(context);
  return 0;
}
