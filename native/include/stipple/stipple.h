/* Stipple: density-controlled Gaussian splats. The one public header, C99.
 * SPDX-License-Identifier: GPL-3.0-or-later
 *
 * How to read this page
 *   Every function returns a StippleStatus. On anything but STIPPLE_OK the outputs are untouched and
 *   stipple_last_error_message() says, for this thread, what is wrong: the argument, the value seen and
 *   the value allowed. No C++ exception leaves the library and it never ends the process.
 *   Option structs start with struct_size; fill them with stipple_..._options_init first, then change
 *   fields. A field counts as given if struct_size reaches its end. ..._init writes the struct as this
 *   header has it, so the ABI version rises when an option struct grows.
 *   Buffers belong to the caller, on both sides. Handles are counted: a job keeps what it uses alive,
 *   so every stipple_..._free may be called at any time; NULL is allowed.
 *   Handles may be used from any thread; one handle must not be used by two threads at once unless a
 *   function says so. Read-only use (info, read, decode, render) of one handle by many threads is safe.
 *
 * Conventions
 *   World: right-handed, metres, Z up. Camera: OpenCV frame (x right, y down, z forward), pixel
 *   centres at +0.5, the first row of an image is its top. Matrices: 16 numbers, row-major, column vectors.
 *   Rotations: w,x,y,z. Scales: linear standard deviations. Opacity: 0..1.
 *   Results never depend on the number of threads.
 */
#ifndef STIPPLE_STIPPLE_H
#define STIPPLE_STIPPLE_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- version ----------------------------------------------------------------------------------- */

/* Raised when a function or struct changes in a way that old callers cannot use, and when an option struct grows:
 * its ..._init would write past the end of an older caller's. */
#define STIPPLE_ABI_VERSION 4u

/* The ABI version of the loaded library; compare with STIPPLE_ABI_VERSION before any other call. */
uint32_t stipple_abi_version(void);
/* "0.1.0"; lives as long as the library. */
const char* stipple_version_string(void);

/* ---- errors ------------------------------------------------------------------------------------ */

typedef enum StippleStatus {
  STIPPLE_OK = 0,
  STIPPLE_ERROR_INVALID_ARGUMENT = 1,
  STIPPLE_ERROR_OUT_OF_MEMORY = 2,
  STIPPLE_ERROR_MEMORY_LIMIT = 3,     /* the call would need more than the context's memory limit; drawing an
                                         image, or more than the machine has */
  STIPPLE_ERROR_IO = 4,               /* the system refused: missing, no permission, disk full */
  STIPPLE_ERROR_FORMAT = 5,           /* the content of a file is wrong */
  STIPPLE_ERROR_UNSUPPORTED = 6,      /* the request is right, but this version cannot do it */
  STIPPLE_ERROR_UNAVAILABLE = 7,      /* a part of the library cannot be loaded on this machine */
  STIPPLE_ERROR_CANCELLED = 8,
  STIPPLE_ERROR_BUFFER_TOO_SMALL = 9,
  STIPPLE_ERROR_INTERNAL = 10
} StippleStatus;

/* Message of the last failed call of this thread; valid until the thread's next call. Never NULL. */
const char* stipple_last_error_message(void);
/* "STIPPLE_ERROR_IO" and so on; never NULL. */
const char* stipple_status_name(StippleStatus status);

/* ---- handles ----------------------------------------------------------------------------------- */

typedef struct StippleContext StippleContext;
typedef struct StippleCloud StippleCloud;       /* splats */
typedef struct StippleMesh StippleMesh;         /* triangles with colours, being put together */
typedef struct StippleDensity StippleDensity;   /* a probability density over an octree */
typedef struct StippleModel StippleModel;       /* density and decoder: a source of splats */
typedef struct StippleViews StippleViews;       /* cameras, and what they have seen */
typedef struct StippleRenderer StippleRenderer;
typedef struct StippleVolume StippleVolume;     /* sparse voxels */
typedef struct StippleImage StippleImage;
typedef struct StippleImageChannels StippleImageChannels; /* named channels of an EXR file */
typedef struct StippleJob StippleJob;           /* long work in the background */
typedef struct StippleWeights StippleWeights;   /* which files of networks' weights a folder has */
typedef struct StippleBinding StippleBinding;   /* splats bound to a mesh at rest */

/* ---- context ----------------------------------------------------------------------------------- */

typedef struct StippleContextOptions {
  uint32_t struct_size;
  uint32_t thread_count;        /* 0: as many as the machine has; at most 1024 */
  uint64_t memory_limit_bytes;  /* 0: 60 % of the machine's memory, UINT64_MAX: no limit. Large calls
                                   refuse before they allocate */
} StippleContextOptions;

void stipple_context_options_init(StippleContextOptions* options);
/* options may be NULL (defaults). The environment variable STIPPLE_BACKEND names what draws and fits;
   not set: "cpu". Errors: STIPPLE_ERROR_INVALID_ARGUMENT for a name that the library does not have. */
StippleStatus stipple_context_create(const StippleContextOptions* options, StippleContext** context);
/* Says where files of networks' weights lie, for assets that name theirs and do not hold it (STIPPLE_MODEL_LATENT).
 * It holds for what is loaded from then on. NULL: the folder that the environment variable STIPPLE_WEIGHTS names, as
 * it is in a context where this was never called. */
StippleStatus stipple_context_set_weights_folder(StippleContext* context, const char* folder_utf8);
/* Says where networks lie that came with the program: where no weights folder is set, theirs is used, and the weights
 * that assets name are looked for in both. NULL: none came. */
StippleStatus stipple_context_set_shipped_weights_folder(StippleContext* context, const char* folder_utf8);
/* Bytes: what the options said, or 60 % of the machine's memory. */
StippleStatus stipple_context_memory_limit(const StippleContext* context, uint64_t* bytes);
void stipple_context_free(StippleContext* context);

/* ---- jobs -------------------------------------------------------------------------------------- */

typedef enum StippleJobState {
  STIPPLE_JOB_RUNNING = 0,
  STIPPLE_JOB_DONE = 1,
  STIPPLE_JOB_FAILED = 2,    /* stipple_job_wait gives status and message */
  STIPPLE_JOB_CANCELLED = 3
} StippleJobState;

typedef struct StippleJobProgress {
  uint32_t struct_size;
  uint32_t state;    /* StippleJobState */
  double fraction;   /* 0..1 */
  char stage[64];    /* short English text, ends with a zero */
  double seconds;    /* by the clock, since the job began; of one that has ended: until then */
} StippleJobProgress;

/* Never waits. In: progress->struct_size set. */
StippleStatus stipple_job_poll(const StippleJob* job, StippleJobProgress* progress);
/* Asks the work to stop soon; it then ends as cancelled. Does not wait. */
StippleStatus stipple_job_cancel(StippleJob* job);
/* Waits until the job has ended and returns its status (its error message becomes this thread's). */
StippleStatus stipple_job_wait(StippleJob* job);
/* Cancels a job that runs and waits for it: the caller's buffers are free afterwards. */
void stipple_job_free(StippleJob* job);
/* These give the result of a finished job as a new handle. Errors: INVALID_ARGUMENT where the job made another
 * kind of thing, or has not ended well. */
StippleStatus stipple_job_model(const StippleJob* job, StippleModel** model);
StippleStatus stipple_job_cloud(const StippleJob* job, StippleCloud** cloud);
StippleStatus stipple_job_volume(const StippleJob* job, StippleVolume** volume);
StippleStatus stipple_job_mesh(const StippleJob* job, StippleMesh** mesh);
StippleStatus stipple_job_weights(const StippleJob* job, StippleWeights** weights);
StippleStatus stipple_job_binding(const StippleJob* job, StippleBinding** binding);

/* ---- splat clouds ------------------------------------------------------------------------------ */

typedef enum StippleColourSpace {
  STIPPLE_COLOUR_DISPLAY = 0, /* srgb_rec709_display: trained splats; composited in display space */
  STIPPLE_COLOUR_LINEAR = 1   /* lin_rec709_display: scene linear Rec.709 */
} StippleColourSpace;

typedef enum StippleAntialias {
  STIPPLE_ANTIALIAS_CLASSIC = 0,
  STIPPLE_ANTIALIAS_MIP = 1
} StippleAntialias;

/* Which way x, y and z of a cloud's positions point: Left or Right, Up or Down, Front or Back. Files keep their
 * frame; writers rotate positions, rotations and harmonics where a format demands another. */
typedef enum StippleFrame {
  STIPPLE_FRAME_UNKNOWN = 0, /* counts as RDF where a format demands a frame */
  STIPPLE_FRAME_LDB = 1,
  STIPPLE_FRAME_RDB = 2,
  STIPPLE_FRAME_LUB = 3,
  STIPPLE_FRAME_RUB = 4,     /* SPZ, glTF */
  STIPPLE_FRAME_LDF = 5,
  STIPPLE_FRAME_RDF = 6,     /* COLMAP, trained 3DGS files */
  STIPPLE_FRAME_LUF = 7,
  STIPPLE_FRAME_RUF = 8,
  STIPPLE_FRAME_LFD = 9,
  STIPPLE_FRAME_RFD = 10,
  STIPPLE_FRAME_LFU = 11,
  STIPPLE_FRAME_RFU = 12,    /* Blender: Z up */
  STIPPLE_FRAME_LBD = 13,
  STIPPLE_FRAME_RBD = 14,
  STIPPLE_FRAME_LBU = 15,
  STIPPLE_FRAME_RBU = 16
} StippleFrame;

typedef struct StippleCloudArrays {
  uint32_t struct_size;
  uint32_t sh_degree;      /* 0..4 */
  uint32_t colour_space;   /* StippleColourSpace */
  uint32_t antialias;      /* StippleAntialias */
  uint64_t count;          /* N >= 0 */
  const float* positions;  /* [N,3] metres */
  const float* rotations;  /* [N,4] w,x,y,z; not zero (normalised on entry) */
  const float* scales;     /* [N,3] linear standard deviations, metres, >= 0 */
  const float* opacities;  /* [N] 0..1 */
  const float* sh;         /* [N,(degree+1)^2,3] coefficient-major, colour fastest, DC first */
  uint32_t frame;          /* StippleFrame */
  uint32_t reserved;
} StippleCloudArrays;

typedef struct StippleCloudInfo {
  uint32_t struct_size;
  uint32_t sh_degree;
  uint32_t colour_space;
  uint32_t antialias;
  uint64_t count;
  float bounds_min[3];  /* of the positions; 0 where count is 0 */
  float bounds_max[3];
  uint32_t frame;       /* StippleFrame */
  uint32_t reserved;
} StippleCloudInfo;

/* Any pointer may be NULL (not wanted). capacity: splats that every given buffer has room for. */
typedef struct StippleCloudBuffers {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t capacity;
  float* positions;
  float* rotations;
  float* scales;
  float* opacities;
  float* sh;
} StippleCloudBuffers;

/* Copies the arrays. Errors: INVALID_ARGUMENT for non-finite values, negative scales, opacities outside
 * 0..1, zero quaternions. Cost: O(N). */
StippleStatus stipple_cloud_create(StippleContext* context, const StippleCloudArrays* arrays,
                                   StippleCloud** cloud);
void stipple_cloud_free(StippleCloud* cloud);
StippleStatus stipple_cloud_info(const StippleCloud* cloud, StippleCloudInfo* info);
/* Errors: BUFFER_TOO_SMALL when capacity < count. */
StippleStatus stipple_cloud_read(const StippleCloud* cloud, const StippleCloudBuffers* buffers);
/* Splats as Blender keeps them, each attribute in an array of its own. rest has the harmonics above degree 0 in
 * the order of StippleCloudArrays, (degree+1)^2 - 1 of them. */
typedef struct StippleCloudColumns {
  uint32_t struct_size;
  uint32_t sh_degree;      /* 0..4 */
  uint32_t colour_space;   /* StippleColourSpace */
  uint32_t antialias;      /* StippleAntialias */
  uint64_t count;          /* N >= 0 */
  const float* positions;  /* [N,3] metres */
  const float* rotations;  /* [N,4] w,x,y,z; not zero (normalised on entry) */
  const float* scales;     /* [N,3] linear standard deviations, metres, >= 0 */
  const float* base;       /* [N,4] harmonics of degree 0, and the opacity, 0..1 */
  const float* rest[24]; /* [N,3] each */
  uint32_t frame;          /* StippleFrame */
  uint32_t reserved;
} StippleCloudColumns;

/* Any pointer may be NULL (not wanted). capacity: splats that every given buffer has room for. Harmonics that the
 * cloud does not have are filled with zeros. */
typedef struct StippleCloudColumnBuffers {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t capacity;
  float* positions;
  float* rotations;
  float* scales;
  float* base;
  float* rest[24];
} StippleCloudColumnBuffers;

/* These do what stipple_cloud_create and stipple_cloud_read do, with the same errors. The cloud is the same from
 * columns as from arrays. Threads: all. Cost: O(N); one pass over memory. */
StippleStatus stipple_cloud_create_from_columns(StippleContext* context, const StippleCloudColumns* columns,
                                                StippleCloud** cloud);
StippleStatus stipple_cloud_read_columns(const StippleCloud* cloud, const StippleCloudColumnBuffers* buffers);
/* Reads a splat file of any format that stipple_format_info lists. The content of the file tells its format. */
StippleStatus stipple_cloud_load(StippleContext* context, const char* path_utf8, StippleCloud** cloud);
/* This reads a file as a job (stipple_job_cloud), for reading ahead: a file that is missing or broken is an error
 * of the job.
 * Errors of both: IO, FORMAT, UNSUPPORTED; MEMORY_LIMIT where the splats take more than the limit. */
StippleStatus stipple_cloud_load_start(StippleContext* context, const char* path_utf8, StippleJob** job);

typedef struct StippleCloudSaveOptions {
  uint32_t struct_size;
  uint32_t ascii;           /* 1: PLY as text */
  uint32_t sh_degree_limit; /* 0..4, default 4: harmonics above it are left out */
  uint32_t format_version;  /* SPZ: 3 or 4; 0, the default: the newest */
  uint32_t frame;           /* StippleFrame that positions are written in; 0: the format's own */
  uint32_t half;            /* 1: USD with all but positions in half precision, smaller by a quarter */
} StippleCloudSaveOptions;
void stipple_cloud_save_options_init(StippleCloudSaveOptions* options);
/* Writes the format that the extension of the path says (stipple_format_info). The file has a temporary name
 * until it is whole. The limits of the format apply: docs/formats.md says what each loses. */
StippleStatus stipple_cloud_save(const StippleCloud* cloud, const char* path_utf8,
                                 const StippleCloudSaveOptions* options);

/* An object of a scene that stipple_scene_save writes. */
typedef struct StippleSceneObject {
  uint32_t struct_size;
  uint32_t reserved;
  const char* name_utf8; /* any; names of prims are made of it, and are unique */
  const StippleCloud* cloud;
  double matrix[16]; /* from the cloud to the scene; invertible */
} StippleSceneObject;
/* Writes objects [count >= 1] into one USD layer or package, each as a prim with its name and its transformation, with
 * the numbers that its cloud has. Splats that several of them show, the same cloud or equal ones, are in the file once,
 * and the objects are instances of them. In: frame: StippleFrame that the matrices lead to; options as of
 * stipple_cloud_save, or NULL. stipple_cloud_load joins them.
 * Errors: INVALID_ARGUMENT for a matrix that is singular or not affine; UNSUPPORTED for paths of other formats, clouds
 * without splats, several colour spaces or low-pass filters; IO. */
StippleStatus stipple_scene_save(const StippleSceneObject* objects, uint64_t count, uint32_t frame,
                                 const char* path_utf8, const StippleCloudSaveOptions* options);

/* Writes clouds as the levels of one streamed SOG scene: a file for each level and chunk of space, and
 * path_utf8, a lod-meta.json in a folder that is there. In: levels [level_count >= 1], finest first, of one
 * colour space, filter and frame; environment, drawn at every level, or NULL; options as of stipple_cloud_save,
 * for every level, or NULL. stipple_cloud_load reads the finest level back. A scene that was there before is kept
 * until the new one is whole, then removed. */
StippleStatus stipple_cloud_save_levels(const StippleCloud* const* levels, uint64_t level_count,
                                        const StippleCloud* environment, const char* path_utf8,
                                        const StippleCloudSaveOptions* options);

/* Writes splats at times into one file of a format that holds them (StippleFormatInfo.holds_times: USD, as time
 * samples). One cloud is in memory at a time, of a .usdz the text of all. The file has a temporary name until
 * stipple_series_writer_finish; a writer that is freed before that leaves nothing. Threads: all, in each call. */
typedef struct StippleSeriesWriter StippleSeriesWriter;
/* In: frames_per_second > 0; options as of stipple_cloud_save, for every cloud, or NULL.
 * Errors: INVALID_ARGUMENT, UNSUPPORTED for paths of other formats, IO. */
StippleStatus stipple_series_writer_create(StippleContext* context, const char* path_utf8, double frames_per_second,
                                           const StippleCloudSaveOptions* options, StippleSeriesWriter** writer);
void stipple_series_writer_free(StippleSeriesWriter* writer);
/* In: cloud, of the degree, colour space and filter of those before, or empty; frame, above that of the cloud before.
 * Errors: INVALID_ARGUMENT, IO. */
StippleStatus stipple_series_writer_add(StippleSeriesWriter* writer, const StippleCloud* cloud, double frame);
/* Errors: INVALID_ARGUMENT where no cloud had a splat, or where it was called before; IO. */
StippleStatus stipple_series_writer_finish(StippleSeriesWriter* writer);

/* Reads splats at times out of one file of such a format. All of its numbers are in memory until the reader is freed.
 * Threads: one call at a time for each reader. */
typedef struct StippleSeriesReader StippleSeriesReader;
typedef struct StippleSeriesInfo {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t frame_count;      /* times at which splats, or what places and hides them, have values; 0: it stands still */
  double frames_per_second;  /* > 0 */
} StippleSeriesInfo;
/* Errors: as of stipple_cloud_load; UNSUPPORTED for files of other formats. */
StippleStatus stipple_series_reader_create(StippleContext* context, const char* path_utf8,
                                           StippleSeriesReader** reader);
void stipple_series_reader_free(StippleSeriesReader* reader);
StippleStatus stipple_series_reader_info(const StippleSeriesReader* reader, StippleSeriesInfo* info);
/* In: index, below frame_count, or 0. Out: frame, the number that the file has for this time; cloud, which may be empty.
 * Between its own times an attribute stays as it was. A file that stands still has what stipple_cloud_load reads, at 0.
 * Errors: INVALID_ARGUMENT, and those of stipple_cloud_load. */
StippleStatus stipple_series_reader_read(StippleSeriesReader* reader, uint64_t index, double* frame,
                                         StippleCloud** cloud);

/* One format of splat files. The texts live as long as the library. */
typedef struct StippleFormatInfo {
  uint32_t struct_size;
  uint32_t can_read;       /* 1 or 0 */
  uint32_t can_write;
  uint32_t max_sh_degree;  /* that it holds */
  uint32_t frame;          /* StippleFrame that positions are written in */
  uint32_t reserved;
  const char* name;        /* one word: "ply" */
  const char* title;       /* for people: "3DGS PLY" */
  const char* extensions;  /* of file names, lower case, separated by blanks; the usual one comes first */
  /* What a file says of its splats beside their numbers; each is 1 or 0. */
  uint32_t keeps_frame;         /* which way the axes point, also where that is another than *frame* */
  uint32_t keeps_colour_space;  /* else linear colours are written as display colours */
  uint32_t keeps_antialias;     /* the low-pass filter that the splats were made for */
  uint32_t holds_times;         /* 1: one file may hold a series (stipple_series_writer_create) */
} StippleFormatInfo;
StippleStatus stipple_format_count(uint64_t* count);
/* index 0..count-1. */
StippleStatus stipple_format_info(uint64_t index, StippleFormatInfo* info);
/* Estimates how many bytes `count` splats take in this format, all files together.
 * In: index as of stipple_format_info; sh_degree 0..4 of the cloud, which the format and the options may lower;
 * options as of stipple_cloud_save, or NULL.
 * Out: bytes, 0 where the format is not written. The sizes of formats that pack their numbers (SPZ, SOG) and of
 * text depend on the scene: the estimate is within about a quarter of them, and within 1 % of the others.
 * Cost: none. */
StippleStatus stipple_format_estimate(uint64_t index, uint64_t count, uint32_t sh_degree,
                                      const StippleCloudSaveOptions* options, uint64_t* bytes);
/* Tells the format of an existing file by its content, or by its extension where the format has no first bytes of
 * its own. A glTF file is one of splats only where it names KHR_gaussian_splatting.
 * Out: index, or *count* of stipple_format_count where the file is of no splat format. */
StippleStatus stipple_format_of_file(const char* path_utf8, uint64_t* index);

/* Moves a cloud by an affine matrix: covariances become M C M^T, and harmonics are rotated (and mirrored) by the
 * orthogonal part of M's polar decomposition; the label of the frame stays. Images equal those of an instance with
 * that matrix, except that colours above degree 0 do not follow uneven scale and shear.
 * Errors: INVALID_ARGUMENT for a matrix that is singular or not affine. */
StippleStatus stipple_cloud_transform(const StippleCloud* cloud, const double matrix[16],
                                      StippleCloud** moved);

/* What an artist sets of the look of a cloud. */
typedef struct StippleGradeSettings {
  uint32_t struct_size;
  uint32_t reserved;
  double exposure;    /* stops, -16..16, default 0; +1 doubles the light */
  double tint[3];     /* factor of the light of each channel, 0..16, default 1 */
  double saturation;  /* 0 (grey)..16, default 1, about Rec.709 luma; applied after exposure and tint */
  double opacity;     /* factor of every splat's opacity, 0..1, default 1 */
} StippleGradeSettings;
void stipple_grade_settings_init(StippleGradeSettings* settings);

/* An affine map of colours as stored: matrix colour + offset, where colour is the sum of the harmonics in any
 * direction + 0.5, before it is clamped; and a factor of opacities. Nothing is clamped by it. */
typedef struct StippleGrade {
  uint32_t struct_size;
  uint32_t reserved;
  double matrix[9];  /* row-major, entries up to 1e9 */
  double offset[3];  /* entries up to 1e9 */
  double opacity;    /* 0..1 */
} StippleGrade;
/* Fills in the grade that changes nothing. */
void stipple_grade_init(StippleGrade* grade);
/* Gives the map of settings, for colours stored in a StippleColourSpace. With f = 2^exposure tint for each
 * channel: scene linear colours become f colour; display colours g colour + 0.055 (g - 1), g = f^(1/2.4), exactly
 * what f does to their light where they lie above the foot of the sRGB curve (0.04045) before and after. Below it
 * the value is off by up to 0.055 |g - 1|. Then luma + saturation (colour - luma), on the stored values.
 * Errors: INVALID_ARGUMENT for a setting outside its range. docs/methods/colour_grade.md. */
StippleStatus stipple_grade_from_settings(const StippleGradeSettings* settings, uint32_t colour_space,
                                          StippleGrade* grade);
/* Gives the cloud with the grade in its harmonics and opacities. Images equal those of an instance with that
 * grade, up to rounding. Cost: O(N). */
StippleStatus stipple_cloud_grade(const StippleCloud* cloud, const StippleGrade* grade, StippleCloud** graded);

typedef struct StippleCloudComparison {
  uint32_t struct_size;
  uint32_t same_order;     /* 1: same count and degree, compared splat by splat */
  uint64_t count_a;
  uint64_t count_b;
  double max_position;     /* metres; the rest in the units of the attribute; 0 unless same_order */
  double max_rotation;     /* radians, sign of the quaternion ignored */
  double max_scale_ratio;  /* largest |ln(scale_a / scale_b)| */
  double max_opacity;
  double max_sh;
  double mean_position;    /* means over all values, in the same units */
  double mean_rotation;
  double mean_scale_ratio;
  double mean_opacity;
  double mean_sh;
} StippleCloudComparison;
/* Compares splat i of a with splat i of b, in the frame of a. Formats that reorder splats (SOG, compressed PLY)
 * give pairs of different splats: compare images of such clouds instead. */
StippleStatus stipple_cloud_compare(const StippleCloud* a, const StippleCloud* b,
                                    StippleCloudComparison* result);

/* ---- meshes ------------------------------------------------------------------------------------ */

#define STIPPLE_NO_INDEX UINT32_MAX

typedef enum StippleMaterialColour {
  STIPPLE_MATERIAL_CONSTANT = 0, /* base_colour */
  STIPPLE_MATERIAL_TEXTURE = 1,  /* texture at the corner UVs */
  STIPPLE_MATERIAL_CORNER = 2    /* corner_colours of the part */
} StippleMaterialColour;

typedef struct StippleMaterial {
  uint32_t struct_size;
  uint32_t colour;         /* StippleMaterialColour */
  float base_colour[4];    /* scene linear, straight alpha */
  uint32_t texture;        /* index given by stipple_mesh_add_texture, or STIPPLE_NO_INDEX */
  uint32_t view_count;     /* 0: looks alike from everywhere; else as many as the mesh's view directions */
  const uint32_t* view_textures; /* [view_count] of 3 channels, at the corner UVs, scene linear, below 0 allowed: what
                                    comes to the colour when it is seen along each view direction; or NULL */
} StippleMaterial;

/* Triangles of one object (or one instance of it). */
typedef struct StippleMeshPart {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t vertex_count;
  uint64_t triangle_count;
  const float* positions;           /* [V,3] object space, metres */
  const uint32_t* triangles;        /* [T,3] vertex indices */
  const float* corner_normals;      /* [T,3,3] object space, or NULL: face normals */
  const float* corner_uvs;          /* [T,3,2] v = 0 at the bottom of the image, or NULL */
  const float* corner_colours;      /* [T,3,4] scene linear, straight alpha, or NULL */
  const uint32_t* triangle_materials; /* [T] indices given by stipple_mesh_add_material; NULL: grey */
  double matrix[16];                /* object to world; invertible */
} StippleMeshPart;

typedef struct StippleMeshInfo {
  uint32_t struct_size;
  uint32_t material_count;
  uint64_t vertex_count;
  uint64_t triangle_count;
  float bounds_min[3];
  float bounds_max[3];
} StippleMeshInfo;

StippleStatus stipple_mesh_create(StippleContext* context, StippleMesh** mesh);
void stipple_mesh_free(StippleMesh* mesh);
/* pixels [height,width,channels] floats, row 0 = top, straight alpha, channels 3 or 4; srgb 1: display
 * values (linearised when read), 0: scene linear. Out: index. */
StippleStatus stipple_mesh_add_texture(StippleMesh* mesh, uint32_t width, uint32_t height,
                                       uint32_t channels, const float* pixels, uint32_t srgb,
                                       uint32_t* index);
StippleStatus stipple_mesh_add_material(StippleMesh* mesh, const StippleMaterial* material,
                                        uint32_t* index);
/* Directions that the view textures of materials are of: [count,3] unit, from the eye to the surface, world. At most
 * 1024; given once, before such materials. */
StippleStatus stipple_mesh_set_view_directions(StippleMesh* mesh, const float* directions, uint32_t count);
/* Appends a part; any number of parts makes one mesh. Errors: INVALID_ARGUMENT for NaN vertices, vertex or
 * material indices out of range, UVs or colours that a material needs and the part lacks. */
StippleStatus stipple_mesh_add_part(StippleMesh* mesh, const StippleMeshPart* part);
/* Reads glTF or GLB. Errors: UNAVAILABLE where libstipple_media cannot be loaded. */
StippleStatus stipple_mesh_load(StippleContext* context, const char* path_utf8, StippleMesh** mesh);
StippleStatus stipple_mesh_info(const StippleMesh* mesh, StippleMeshInfo* info);

/* Any pointer may be NULL (not wanted). */
typedef struct StippleMeshBuffers {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t vertex_capacity;    /* that positions has room for */
  uint64_t triangle_capacity;
  float* positions;            /* [V,3] metres */
  uint32_t* triangles;         /* [T,3] vertex indices, counterclockwise from outside */
} StippleMeshBuffers;
/* Errors: BUFFER_TOO_SMALL. */
StippleStatus stipple_mesh_read(const StippleMesh* mesh, const StippleMeshBuffers* buffers);

typedef struct StippleMeshTopology {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t edge_count;
  uint64_t open_edge_count; /* that two triangles, running against each other, do not share; 0: closed */
  uint64_t piece_count;     /* of triangles that share vertices */
  int64_t euler;            /* vertices - edges + triangles; 2 for a sphere */
  double volume;            /* enclosed, cubic metres; hollows take theirs away */
} StippleMeshTopology;
/* Cost: O(T log T). */
StippleStatus stipple_mesh_topology(const StippleMesh* mesh, StippleMeshTopology* topology);
/* Writes positions and triangles in the format that the extension says: .ply, or .glb (Z up becomes Y up).
 * Errors: UNAVAILABLE without libstipple_media.so for .glb. */
StippleStatus stipple_mesh_save(const StippleMesh* mesh, const char* path_utf8);
/* Writes the glTF or GLB file that a mesh was loaded from as a .glb, with the positions of this mesh, which has its
 * vertices and triangles in its order, and with its normals where the file has some. Everything else in the file stays:
 * UVs, colours, materials, pictures, nodes, skins, animations, morph targets as differences from the new shape.
 * Tangents go, since they belong to the old shape.
 * Errors: IO; FORMAT; INVALID_ARGUMENT for a mesh of other numbers of vertices or triangles; UNSUPPORTED for another
 * extension and for a file that shows a mesh several times; UNAVAILABLE without libstipple_media.so. */
StippleStatus stipple_mesh_save_reshaped(const StippleMesh* mesh, const char* source_utf8, const char* path_utf8);

/* ---- meshes that take another shape --------------------------------------------------------------- */

/* Where vertices go while a template takes the shape of a target. */
typedef enum StippleMeshDensity {
  STIPPLE_MESH_DENSITY_OFF = 0,     /* wherever the target alone pulls them */
  STIPPLE_MESH_DENSITY_UNIFORM = 1, /* even edges, through the first two fifths of the steps */
  STIPPLE_MESH_DENSITY_ADAPTIVE = 2 /* even edges through a fifth, then shorter ones where the shape is complex */
} StippleMeshDensity;

/* What is done to the whole template before that. */
typedef enum StippleMeshAlignment {
  STIPPLE_MESH_ALIGN_NONE = 0,      /* it lies over the target already */
  STIPPLE_MESH_ALIGN_SIZE = 1,      /* it gets the target's middle and size */
  STIPPLE_MESH_ALIGN_RIGID = 2,     /* it is turned and moved to the nearest points, or to three landmarks or more */
  STIPPLE_MESH_ALIGN_SIMILARITY = 3 /* the same, and scaled */
} StippleMeshAlignment;

/* What a template is drawn as, to be compared with images. */
typedef enum StipplePictureDrawing {
  STIPPLE_PICTURE_DRAWING_TRIANGLES = 0, /* with sharp outlines */
  STIPPLE_PICTURE_DRAWING_SPLATS = 1     /* flat splats that follow the triangles, by the renderer of splats */
} StipplePictureDrawing;

/* Exactly one of mesh, cloud, points, points_path_utf8 and views is given. */
typedef struct StippleMeshAdaptTarget {
  uint32_t struct_size;
  uint32_t reserved;
  const StippleMesh* mesh;
  const StippleCloud* cloud;  /* splats count by their opacity; flat ones have their shortest axis for a normal */
  const float* points;        /* [P,3] metres */
  const float* normals;       /* [P,3] of any length, or NULL: none are known */
  uint64_t point_count;       /* P */
  const char* points_path_utf8; /* a .ply whose vertices are the points, with nx ny nz for normals where it has them */
  const StippleViews* views;    /* images with alpha or masks, of one surface of one colour in one light: outlines
                                   and shades tell its shape. Alignment none or size; no landmarks; the numbers of
                                   points and samples and the weights of distances have no part */
} StippleMeshAdaptTarget;

/* Weights are those of the target in the unit ball, whatever the unit of the scene is. */
typedef struct StippleMeshAdaptOptions {
  uint32_t struct_size;
  uint32_t density;           /* StippleMeshDensity, default adaptive */
  uint32_t alignment;         /* StippleMeshAlignment, default none */
  uint32_t steps;             /* 1..1000000, default 800 */
  uint32_t samples_per_point; /* 1..64, default 4: of the template for each point of the target */
  uint32_t lands_on_target;   /* 1: vertices end at the nearest place of the target's triangles, those of borders at
                                 its borders; default 0. With the template itself as the target, they slide on it until
                                 they are even: only density, steps, sharp_angle and report_count have a part then, a
                                 few dozen steps are enough, and landmarks are refused */
  uint64_t target_count;      /* points of the target at most, 1..2^24, default 20000: detail, and time */
  uint64_t report_count;      /* samples of each side that the report is measured by, default 100000; 0: none */
  uint64_t seed;              /* of all samples */
  double strength;            /* of the density, >= 0, default 1.5 */
  double adaptive_factor;     /* by which adapting is stronger than evening out, >= 0, default 3 */
  double smoothness;          /* lambda of I + lambda L, >= 0, default 10: broader steps, later detail */
  double step_size;           /* 0..10, default 0.05; it falls to a tenth over the last tenth of the steps */
  double position_weight;     /* of the mean squared distance, >= 0, default 1 */
  double normal_weight;       /* of the mean of 1 - cosine between normals, >= 0, default 1 */
  double landmark_weight;     /* of the mean squared distance of landmarks, >= 0, default 1 */
  double symmetric_weight;    /* of the mean squared distance from template to target, >= 0, default 0 */
  uint64_t landmark_count;            /* L, default 0 */
  const uint32_t* landmark_vertices;  /* [L] of the template */
  const float* landmark_places;       /* [L,3] metres, where they belong */
  uint32_t picture_side;      /* of views: pixels of the longer side that are looked at, 16..4096, default 256: finer
                                 detail, and its square in time */
  uint32_t picture_drawing;   /* StipplePictureDrawing, of views, default triangles */
  double sharp_angle;         /* 0..pi, default pi/4, of templates that slide on themselves: edges whose faces, and lines of
                                 edges that differ by more stay as they are; vertices on them move along them alone */
} StippleMeshAdaptOptions;
void stipple_mesh_adapt_options_init(StippleMeshAdaptOptions* options);

/* Distances are means of both ways, metres: from samples of each side to the nearest place of the other. */
typedef struct StippleMeshAdaptReport {
  uint32_t struct_size;
  uint32_t is_measured;    /* 0: report_count was 0 or the target is views, and the six numbers from distance_before are 0 */
  uint32_t has_normals;    /* 0: the target knows none, and their differences are 0 */
  uint32_t turned_normals; /* 1: template and target looked opposite ways, one in and one out; the target was turned */
  uint64_t place_count;    /* of the template: vertices, those in one place once */
  uint64_t loose_count;    /* vertices without a triangle, which went with the alignment alone */
  double loss;             /* of the last step, in the unit ball, without density */
  double distance_before;
  double distance_after;
  double squared_before;   /* means of squared distances, square metres */
  double squared_after;
  double normals_before;   /* mean squared difference of unit normals, 0..4 */
  double normals_after;
  uint64_t step_count;     /* steps that were taken: fewer after stipple_mesh_adapt_finish */
  double picture_before;   /* of views, for which is_measured is 0: mean difference of linear colours and coverage */
  double picture_after;
} StippleMeshAdaptReport;

/* Gives a template the shape of a target by moving its vertices, as a job (stipple_job_mesh): triangles, their order,
 * UVs, colours and materials stay; corner normals follow. Vertices in one place move as one, whatever seam they were
 * split for. Edges of any number of triangles and several islands are allowed. The result is the same for any number
 * of threads; a cancelled job leaves nothing.
 * Errors of the start: INVALID_ARGUMENT, MEMORY_LIMIT; of the job: INVALID_ARGUMENT for a template of fewer than four
 * triangles with area, NaN, a target without points, extent or visible splats, landmarks of vertices that are missing
 * or loose, views without alpha and masks, of which fewer than two are there, or which look the same way.
 * Cost: steps times a k-d tree of target_count * samples_per_point samples and some solves.
 * Source: Jung, Kim et al., Mesh Density Adaptation for Template-based Shape Reconstruction, SIGGRAPH 2023.
 * docs/methods/mesh_adaptation.md. */
StippleStatus stipple_mesh_adapt_start(const StippleMesh* given, const StippleMeshAdaptTarget* target,
                                       const StippleMeshAdaptOptions* options, StippleJob** job);
StippleStatus stipple_mesh_adapt_memory_bound(const StippleMesh* given, const StippleMeshAdaptTarget* target,
                                              const StippleMeshAdaptOptions* options, uint64_t* bytes);
/* *mesh: the newest shape of a job that adapts a mesh, which is given once; NULL where there is no newer one. Asks for
 * the next one too: shapes are made at the pace that they are taken, and the first call gives none. Never waits. */
StippleStatus stipple_mesh_adapt_preview(StippleJob* job, StippleMesh** mesh);
/* Asks the steps to end soon; the job then ends well, with the shape that it has. Does not wait. */
StippleStatus stipple_mesh_adapt_finish(StippleJob* job);
/* Of a job that adapted a mesh and has ended well. Errors: INVALID_ARGUMENT. */
StippleStatus stipple_job_adapt_report(const StippleJob* job, StippleMeshAdaptReport* report);

/* ---- density and anchors ----------------------------------------------------------------------- */

typedef enum StippleAnchorOrder {
  STIPPLE_ORDER_SYSTEMATIC = 0,  /* every child count is floor or ceil of its expectation */
  STIPPLE_ORDER_PROGRESSIVE = 1  /* a smaller budget is a subset of a larger one, same seed */
} StippleAnchorOrder;

#define STIPPLE_MAX_ANCHORS (1u << 28)

typedef struct StippleDensityInfo {
  uint32_t struct_size;
  uint32_t leaf_level;
  uint64_t leaf_count;
  double root_origin[3];  /* metres */
  double root_side;
} StippleDensityInfo;

typedef struct StippleSampleOptions {
  uint32_t struct_size;
  uint32_t order;   /* StippleAnchorOrder */
  uint64_t count;   /* 1..STIPPLE_MAX_ANCHORS; exactly this many come back */
  uint64_t seed;
} StippleSampleOptions;
void stipple_sample_options_init(StippleSampleOptions* options);

/* Any pointer may be NULL; each given buffer has room for options->count anchors. */
typedef struct StippleAnchorBuffers {
  uint32_t struct_size;
  uint32_t reserved;
  float* positions;   /* [P,3] metres, world of the density */
  float* log_q;       /* [P] natural logarithm of the probability of the anchor's leaf */
  uint64_t* leaves;   /* [P] Morton code, ascending */
  uint64_t* ranks;    /* [P] budget from which on the anchor exists; progressive only */
} StippleAnchorBuffers;

/* positions [count,3] metres, weights [count] >= 0 or NULL (all 1); leaf_level 1..10. */
StippleStatus stipple_density_from_points(StippleContext* context, const float* positions,
                                          const float* weights, uint64_t count, uint32_t leaf_level,
                                          StippleDensity** density);
void stipple_density_free(StippleDensity* density);
StippleStatus stipple_density_info(const StippleDensity* density, StippleDensityInfo* info);
StippleStatus stipple_density_sample(const StippleDensity* density, const StippleSampleOptions* options,
                                     const StippleAnchorBuffers* buffers);

/* ---- models: sources of splats ----------------------------------------------------------------- */

typedef struct StippleModelFromMeshOptions {
  uint32_t struct_size;
  uint32_t leaf_level;     /* 1..10, default 10 */
  uint64_t sample_count;   /* surface samples, 1000..2^26; 0: chosen from the mesh */
  uint64_t seed;
  double detail_weight;    /* >= 0; 0: anchors uniform over the area; default 1 */
  uint32_t harmonic_degree; /* 0..3, default 3: of the harmonics that show view textures; meshes without have none */
  uint32_t reserved;
} StippleModelFromMeshOptions;
void stipple_model_from_mesh_options_init(StippleModelFromMeshOptions* options);

/* Where the views of an existing cloud are. */
typedef enum StippleViewRig {
  STIPPLE_RIG_AUTOMATIC = 0, /* around; alternately around and inside where the cloud surrounds its own middle */
  STIPPLE_RIG_AROUND = 1,    /* from a sphere around the cloud */
  STIPPLE_RIG_INSIDE = 2     /* from places near the middle, looking out */
} StippleViewRig;

typedef struct StippleModelFromCloudOptions {
  uint32_t struct_size;
  uint32_t view_rig;    /* StippleViewRig, default automatic */
  uint32_t view_count;  /* images that tell which splats are seen, 0..4096, default 10; 0: all splats count as seen */
  uint32_t view_size;   /* pixels per side, 1..65536, default 400 */
  uint64_t seed;        /* of the views */
  double footprint;     /* metres: standard deviation of the low-pass through which errors are judged; 0, the
                           default: half a pixel where the cloud fills an image of 800 */
} StippleModelFromCloudOptions;
void stipple_model_from_cloud_options_init(StippleModelFromCloudOptions* options);

typedef enum StippleModelKind {
  STIPPLE_MODEL_SURFACE = 0,  /* of a mesh: density and surface */
  STIPPLE_MODEL_HIERARCHY = 1, /* of a cloud: its merge tree; any budget up to its count */
  STIPPLE_MODEL_FIELD = 2,    /* learned from views: density and a field of attributes */
  STIPPLE_MODEL_LATENT = 3,   /* generated: a latent that two networks turn into a density and splats */
  STIPPLE_MODEL_MOTION = 4,   /* splats that move; always all of them, at any time of their clip */
  STIPPLE_MODEL_SCAFFOLD = 5, /* anchors in the order of their worth, and networks that make splats of them */
  STIPPLE_MODEL_RELAY = 6     /* such anchors at key frames of a long clip: any time of it */
} StippleModelKind;

typedef struct StippleModelInfo {
  uint32_t struct_size;
  uint32_t leaf_level;    /* surface; 0 for a hierarchy */
  uint64_t leaf_count;    /* surface: of the octree; hierarchy: splats of the cloud, the largest budget */
  uint64_t sample_count;  /* surface; 0 for a hierarchy */
  float bounds_min[3];
  float bounds_max[3];
  uint32_t kind;          /* StippleModelKind */
  uint32_t sh_degree;     /* of the splats that it makes */
  uint64_t min_anchors;   /* field: the budgets that it was trained for; else 0 */
  uint64_t max_anchors;
  uint32_t gaussians_per_anchor; /* field: splats that it makes of an anchor; else 0 */
  uint32_t reserved;
  const char* kind_label; /* what people call the kind, such as "learned field"; it lives as long as the library */
} StippleModelInfo;

/* What the budget of a model (StippleDecodeOptions.anchor_count) counts. */
typedef enum StippleBudgetUnit {
  STIPPLE_BUDGET_ANCHORS = 0, /* places that are drawn from its density; each becomes K splats */
  STIPPLE_BUDGET_SPLATS = 1   /* splats of its own; the largest budget is all of them, bit for bit */
} StippleBudgetUnit;

/* Which settings a model has. Whoever offers them to people asks this, and need not know the kinds. A setting
 * that a model does not have may be given and does not matter. */
typedef struct StippleModelSettings {
  uint32_t struct_size;
  uint32_t budget_unit;             /* StippleBudgetUnit */
  uint64_t minimum_budget;          /* the smallest budget that it takes */
  uint64_t maximum_budget;
  uint64_t default_budget;          /* that shows it well */
  uint64_t minimum_learned_budget;  /* the smallest budget that it was learned for; 0: all budgets are alike to it */
  uint64_t maximum_learned_budget;
  uint32_t minimum_gaussians_per_anchor; /* K; where both are equal there is no choice */
  uint32_t maximum_gaussians_per_anchor;
  uint32_t default_gaussians_per_anchor;
  uint32_t has_order;   /* 1: StippleAnchorOrder changes the splats */
  uint32_t has_seed;    /* 1: the seed changes the splats */
  uint32_t takes_mask;  /* 1: splats of its own can be left out (stipple_model_keep) */
  uint32_t has_time;    /* 1: the time changes the splats */
  uint32_t has_smooth;  /* 1: StippleDecodeOptions.smooth changes the splats */
  double time_begin;    /* seconds, where has_time: from when to when something moves */
  double time_end;
} StippleModelSettings;

typedef struct StippleDecodeOptions {
  uint32_t struct_size;
  uint32_t order;                 /* StippleAnchorOrder, default systematic; of a learned field always
                                     progressive, as it was learned */
  uint64_t anchor_count;          /* P, 1..STIPPLE_MAX_ANCHORS, default 20,000; of a hierarchy: up to its count */
  uint64_t seed;                  /* of a learned field: 0, the default, gives the draws that it knows best */
  uint32_t gaussians_per_anchor;  /* K, 1..32, default 1; of a hierarchy: 1; of a field: 1, which stands for
                                     its own count, or that */
  uint32_t smooth;                /* 1: for budgets that move: none of the splats jumps. Up to twice as many as the
                                     budget says are on their way to the next power of two; the order is
                                     progressive, and the model keeps what is around the last budget. Of a
                                     hierarchy, what the next half of a doubling splits is on its way, 1.41 times
                                     as many at most. Default 0 */
  double time;                    /* seconds, finite, default 0; models without has_time give the same splats always */
} StippleDecodeOptions;
void stipple_decode_options_init(StippleDecodeOptions* options);

/* Makes the surface samples, density and decoder of a mesh, as a job (stipple_job_model). */
StippleStatus stipple_model_from_mesh_start(StippleContext* context, const StippleMesh* mesh,
                                            const StippleModelFromMeshOptions* options,
                                            StippleJob** job);
/* Makes the merge tree of an existing cloud, as a job (stipple_job_model). Decoded at P it gives exactly P splats:
 * those of the whole cloud bit for bit where P is its count. At P + 1 one splat is replaced by the two that it was
 * merged from. order and seed of the decode options do not matter. The result is the same for any number of
 * threads.
 * Errors: INVALID_ARGUMENT for an empty cloud; MEMORY_LIMIT.
 * Cost: a few microseconds per splat, and the drawing of the images (docs/methods/reduction.md). */
StippleStatus stipple_model_from_cloud_start(StippleContext* context, const StippleCloud* cloud,
                                             const StippleModelFromCloudOptions* options,
                                             StippleJob** job);
/* Reads an asset file (docs/formats.md). Tensors and metadata of a newer minor version are kept with the model as
 * it was loaded and saved with it; models made from it do not have them.
 * Errors: UNSUPPORTED for a newer major version; FORMAT with what is wrong; UNAVAILABLE where it names a file of
 * weights that is not in the context's weights folder.
 * Cost: files of weights are read once in a process, to compare their SHA-256. */
StippleStatus stipple_model_load(StippleContext* context, const char* path_utf8, StippleModel** model);
/* This does the same as a job (stipple_job_model). */
StippleStatus stipple_model_load_start(StippleContext* context, const char* path_utf8, StippleJob** job);
StippleStatus stipple_model_save(const StippleModel* model, const char* path_utf8);
void stipple_model_free(StippleModel* model);
StippleStatus stipple_model_info(const StippleModel* model, StippleModelInfo* info);
/* Tells which settings a model has, and their ranges. settings->struct_size must be set. */
StippleStatus stipple_model_settings(const StippleModel* model, StippleModelSettings* settings);
/* Errors: UNSUPPORTED for a model that is not sampled, such as a hierarchy. */
StippleStatus stipple_model_density(const StippleModel* model, StippleDensity** density);
/* Decodes P anchors to P*K splats. This is fast enough to follow a slider (docs/results/surfaces.md has
 * figures). */
StippleStatus stipple_model_decode(const StippleModel* model, const StippleDecodeOptions* options,
                                   StippleCloud** cloud);
/* This does the same as a job (stipple_job_cloud). */
StippleStatus stipple_model_decode_start(const StippleModel* model, const StippleDecodeOptions* options,
                                         StippleJob** job);
StippleStatus stipple_model_decode_memory_bound(const StippleModel* model,
                                                const StippleDecodeOptions* options, uint64_t* bytes);

typedef struct StippleRefineOptions {
  uint32_t struct_size;
  uint32_t iterations;  /* steps, 0..1,000,000, default 100; 0 gives the cloud as it is */
  uint32_t view_count;  /* images of the full cloud, 1..4096, default 32 */
  uint32_t view_size;   /* pixels per side, 1..65536, default 800 */
  uint32_t view_rig;    /* StippleViewRig, default automatic */
  uint32_t reserved;
  uint64_t seed;        /* of the views */
  double seconds;       /* it ends after these, with as many of the iterations as fit, by this machine's clock; 0, the
                           default: it takes all of them */
} StippleRefineOptions;
void stipple_refine_options_init(StippleRefineOptions* options);

/* Fits a reduced cloud (a decoded model) to images of the full one, as a job (stipple_job_cloud): positions,
 * rotations, scales, opacities and harmonics change; the count and the order stay. The result is the same for any
 * number of threads, but where seconds decide how many steps there are.
 * Errors: INVALID_ARGUMENT for options out of range, an empty cloud or clouds of different colour space; MEMORY_LIMIT before anything is
 * allocated, where the images (12 bytes per pixel of every view) and the passes would need more than the context's
 * limit.
 * Cost: one drawing of `full` per view, one drawing and one backward pass of `cloud` per iteration. */
StippleStatus stipple_cloud_refine_start(const StippleCloud* cloud, const StippleCloud* full,
                                         const StippleRefineOptions* options, StippleJob** job);
/* The same with images of the mesh that the cloud was made from, in its own colours, without light. Automatic views
 * are from around, and from inside as well where the faces look at the middle of the mesh, as in a room.
 * Errors: also INVALID_ARGUMENT for a cloud of scene linear colours. */
StippleStatus stipple_cloud_refine_to_mesh_start(const StippleCloud* cloud, const StippleMesh* mesh,
                                                 const StippleRefineOptions* options, StippleJob** job);

/* ---- cameras ----------------------------------------------------------------------------------- */

/* The last three models see directions, not a plane: their images are drawn along rays only
 * (STIPPLE_RENDER_RAYS, STIPPLE_RENDER_RAYS_UNLIMITED), their depths are distances from the camera, their near
 * and far planes are spheres, and splats come in the order of their distances. With a the angle between ray and
 * axis: */
typedef enum StippleCameraModel {
  STIPPLE_CAMERA_PERSPECTIVE = 0,
  STIPPLE_CAMERA_ORTHOGRAPHIC = 1,
  /* Longitude (x - cx) / fx to the right and latitude (cy - y) / fy upwards; at most 360 by 180 degrees. */
  STIPPLE_CAMERA_EQUIRECTANGULAR = 2,
  STIPPLE_CAMERA_FISHEYE_EQUIDISTANT = 3, /* a = r, r = |((x - cx) / fx, (y - cy) / fy)| */
  STIPPLE_CAMERA_FISHEYE_EQUISOLID = 4    /* r = 2 sin(a / 2): equal areas of the image are equal solid angles */
} StippleCameraModel;

typedef struct StippleCamera {
  uint32_t struct_size;
  uint32_t model;   /* StippleCameraModel */
  uint32_t width;   /* pixels, 1..65536 */
  uint32_t height;
  double fx, fy;    /* perspective: pixels; orthographic: pixels per metre; others: pixels per radian (at the axis) */
  double cx, cy;    /* pixels, from the top left corner */
  double world_to_camera[16]; /* rigid */
  double near_plane;          /* metres */
  double far_plane;
  /* Of fisheyes: the full angle, radians, up to 2 pi; pixels beyond it are empty, and have no background either.
   * 0: all that the model holds, 2 pi. Of other models: 0. */
  double field_of_view;
} StippleCamera;

/* Reads the cameras of transforms.json (nerfstudio, NeRF-synthetic) or a COLMAP model. path_utf8: a file, or a
 * folder with transforms.json, else with transforms_train.json (and _test, _val), else with images.bin or
 * images.txt in it or in sparse/0.
 * Errors: UNSUPPORTED for distorted cameras; stipple_views_open makes pinholes of them. */
StippleStatus stipple_views_load(StippleContext* context, const char* path_utf8, StippleViews** views);
void stipple_views_free(StippleViews* views);
StippleStatus stipple_views_count(const StippleViews* views, uint64_t* count);
/* A file without sizes gives width and height 0: set them, with stipple_camera_resize, before use. */
StippleStatus stipple_views_camera(const StippleViews* views, uint64_t index, StippleCamera* camera);
/* Gives the same view another size: intrinsics scale with it. A camera of size 0 x 0 keeps its angle of view
 * over the width. */
StippleStatus stipple_camera_resize(StippleCamera* camera, uint32_t width, uint32_t height);

/* Where cameras of a fit stand that see a scene from everywhere: around things, or inside a room. The search does not
 * know the scene; it asks which rays meet what, and the caller answers, until nothing is asked any more:
 *   create; while rays gives a count above 0: cast them, answer; camera for each view. */
typedef struct StippleRigSearch StippleRigSearch;

typedef struct StippleRigSearchOptions {
  uint32_t struct_size;
  uint32_t view_rig;    /* StippleViewRig; automatic, the default: inside where the viewer stands between walls */
  uint32_t view_count;  /* 1..4096, default 10 */
  uint32_t view_size;   /* pixels per side, 1..65536, default 400 */
  uint32_t has_viewer;  /* 1: viewer is given; default 0 */
  uint32_t reserved;
  uint64_t seed;        /* other seeds give other views, spread as evenly */
  double angle;         /* full, of both sides, radians, below pi; 0, the default: 40 degrees around, 75 inside */
  double bounds_min[3]; /* of all that is to be seen; world, z up, metres */
  double bounds_max[3];
  double viewer[3];     /* where the scene's own camera stands */
} StippleRigSearchOptions;
void stipple_rig_search_options_init(StippleRigSearchOptions* options);

/* What N rays met first. */
typedef struct StippleRayHits {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t count;              /* N */
  const double* distances;     /* [N] metres from the origin; infinity: nothing */
  const double* normals;       /* [N,3] of the faces, world, as they point */
  const uint32_t* objects;     /* [N] which object, 0..object_count-1 */
  uint64_t object_count;       /* M */
  const double* object_sizes;  /* [M,3] sides of the objects' boxes along the world's axes, metres */
} StippleRayHits;

/* Errors: INVALID_ARGUMENT for options out of range. */
StippleStatus stipple_rig_search_create(const StippleRigSearchOptions* options, StippleRigSearch** search);
void stipple_rig_search_free(StippleRigSearch* search);
/* Gives the rays that are to be cast now.
 * In: capacity, rays that there is room for.
 * Out: rays [count,7]: origin, direction (unit) and the farthest distance that counts (infinity: any), or NULL:
 * only the number is wanted; count, 0: the cameras are known.
 * Errors: BUFFER_TOO_SMALL, with count set. */
StippleStatus stipple_rig_search_rays(const StippleRigSearch* search, uint64_t capacity, double* rays, uint64_t* count);
/* Takes what these rays met, in their order. Errors: INVALID_ARGUMENT for another number of answers, and where
 * no place is left for a camera. The same answers give the same cameras. */
StippleStatus stipple_rig_search_answer(StippleRigSearch* search, const StippleRayHits* hits);
/* index 0..view_count-1. Errors: INVALID_ARGUMENT while rays are to be asked. */
StippleStatus stipple_rig_search_camera(const StippleRigSearch* search, uint64_t index, StippleCamera* camera);

/* ---- views with images ------------------------------------------------------------------------ */

/* Splats are fitted to views: photographs from files, or renders that are handed in. */

/* What a data set says a view is for. */
typedef enum StippleViewSplit {
  STIPPLE_VIEW_SPLIT_NONE = 0, /* nothing is said */
  STIPPLE_VIEW_SPLIT_TRAIN = 1,
  STIPPLE_VIEW_SPLIT_TEST = 2,
  STIPPLE_VIEW_SPLIT_VALIDATION = 3
} StippleViewSplit;

/* The image of a view. Its arrays are read during the call. Row 0 is the top; the size is that of the camera. */
typedef struct StippleViewImage {
  uint32_t struct_size;
  uint32_t transfer;     /* StippleTransfer of rgba; it is converted to the views' colour space */
  const float* rgba;     /* [H,W,4] premultiplied, alpha 0..1 */
  const float* weights;  /* [H,W] >= 0, what a pixel counts (a mask). NULL: 1 */
  const float* depth;    /* [H,W] planar z, metres; 0, and 1e10 and more: unknown. NULL: unknown */
  const float* normals;  /* [H,W,3] unit, world; 0: unknown. NULL: unknown */
  double time;           /* when it was taken, seconds, finite; 0, and where the struct ends early: nothing moves */
  uint32_t split;        /* StippleViewSplit, what the view is for; 0: the fit's holdout says it */
  uint32_t reserved;
  const char* camera_utf8; /* whose image it is, where the same camera has others of other times. NULL: unknown */
  const uint8_t* moving; /* [H,W] not 0 where something moves: where a fit measures moving pixels. NULL: told by how
                            the images of its camera differ, where it stands still */
} StippleViewImage;

/* Where surfaces are known to be, in the world of the cameras. */
typedef struct StippleViewPoints {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t count;          /* N >= 0 */
  const float* positions;  /* [N,3] metres */
  const float* colours;    /* [N,3] scene linear */
  const float* normals;    /* [N,3] unit. NULL: unknown */
  const float* weights;    /* [N] >= 0, what a point counts. NULL: alike */
  const double* times;     /* [N] seconds at which the points were there, where things move; NaN: at all times, and
                              then those with a time move on. NULL: unknown */
} StippleViewPoints;

typedef struct StippleViewsInfo {
  uint32_t struct_size;
  uint32_t colour_space;  /* StippleColourSpace, in which the images are composited */
  uint64_t view_count;
  uint64_t point_count;
  uint32_t has_images;    /* 0: there are cameras alone (stipple_views_load) */
  uint32_t reserved;
  uint64_t found_count;   /* images that were there before frames and images were chosen */
  uint64_t camera_count;  /* cameras of several images at different times; 0: none */
  uint64_t frame_count;   /* times that differ */
  double time_begin;      /* seconds */
  double time_end;
} StippleViewsInfo;

/* The texts live as long as the handle. */
typedef struct StippleViewInfo {
  uint32_t struct_size;
  uint32_t split;             /* StippleViewSplit */
  uint32_t source_width;      /* pixels of the image in its file; 0 where it was handed in */
  uint32_t source_height;
  uint32_t is_distorted;      /* 1: the image in the file is distorted; that is taken out when it is read */
  uint32_t reserved;
  const char* name;
  const char* image_path;     /* the file of the image; empty where there is none */
  const char* camera_model;   /* as its source calls it: "OPENCV" */
  double time;                /* when the image was taken, seconds; 0 where nothing is said */
} StippleViewInfo;

/* Any pointer may be NULL. capacity: pixels that each given buffer has room for. */
typedef struct StippleViewBuffers {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t capacity;
  float* rgba;     /* [H,W,4] premultiplied, in the views' colour space */
  float* weights;  /* [H,W] 1 where no mask is */
  float* depth;    /* [H,W] planar z, metres; 0 where unknown */
  float* normals;  /* [H,W,3] world; 0 where unknown */
} StippleViewBuffers;

typedef struct StippleViewsOpenOptions {
  uint32_t struct_size;
  uint32_t downscale;    /* 1..64, default 1: pixels of the file along each side of a pixel, averaged by area */
  uint64_t cache_bytes;  /* decoded images that stay in memory, default 1 GiB; at most a quarter of the context's
                            limit. Other images are read again when they are wanted */
  uint32_t with_frames;  /* 1: numbered frames that lie in the folder of a camera's image are views, too; 0, the
                            default: listed images alone (of poses_bounds.npy each camera's first frame) */
  uint32_t reserved;
  double frame_rate;     /* frames per second: image n was taken at n / frame_rate seconds, where the file of cameras
                            says no time. 0, the default: 30 of frames that lie beside listed images, and else
                            numbers in names say nothing */
  uint64_t first_frame;  /* default 0; by number, or where files say times, counted from 0 in their order. A later
                            first frame that is there takes its place */
  uint64_t last_frame;   /* default UINT64_MAX */
  uint64_t frame_step;   /* at least 1, the default: every so many-th frame from the first */
  uint64_t max_images;   /* spread evenly over frames and cameras; 0, the default: all */
  const char* held_out_cameras_utf8; /* names with commas between: their views are for testing, all others for
                            training. NULL, the default: as the data set says */
} StippleViewsOpenOptions;
void stipple_views_open_options_init(StippleViewsOpenOptions* options);

/* Opens a photo data set: a COLMAP model with its images, transforms.json of nerfstudio, a NeRF-synthetic folder, or
 * poses_bounds.npy beside a folder of images for each camera (path_utf8 as in stipple_views_load); options may be NULL. Lens distortion is taken out of images as they
 * are read: cameras are pinholes. The colour space is that of the first image: display of 8 and 16 bits, scene
 * linear of float. Masks give the weights. docs/formats.md, Data sets.
 * Errors: IO where images are missing, with the first of them; FORMAT; UNSUPPORTED for camera models that are not
 * known, and for videos; INVALID_ARGUMENT for options out of range, frames of which none is there, and names of no
 * camera; MEMORY_LIMIT where the largest image cannot be read within it. No image is decoded.
 * Cost: one header is read per file where the cameras say no size, and of each numbered frame. */
StippleStatus stipple_views_open(StippleContext* context, const char* path_utf8,
                                 const StippleViewsOpenOptions* options, StippleViews** views);
/* Makes a set that has no views yet. In: colour_space, a StippleColourSpace: that of the splats to be. */
StippleStatus stipple_views_create(StippleContext* context, uint32_t colour_space, StippleViews** views);
/* Adds a view, and copies its image (0..1 as 16 bits). name_utf8 may be NULL: the view is then called "view" and
 * its number. Jobs under way do not see what is added.
 * Errors: INVALID_ARGUMENT, by name and pixel, for values that are not finite or out of range, a time that is not
 * finite, and for views that were not made by stipple_views_create; MEMORY_LIMIT. */
StippleStatus stipple_views_add(StippleViews* views, const StippleCamera* camera,
                                const StippleViewImage* image, const char* name_utf8);
/* Sets the points, in the place of earlier ones. Errors: as of stipple_views_add. */
StippleStatus stipple_views_set_points(StippleViews* views, const StippleViewPoints* points);
StippleStatus stipple_views_info(const StippleViews* views, StippleViewsInfo* info);
StippleStatus stipple_views_view_info(const StippleViews* views, uint64_t index, StippleViewInfo* info);
/* Reads the image of a view, from its file where it has one. Its size is that of stipple_views_camera. Errors:
 * BUFFER_TOO_SMALL; UNSUPPORTED for cameras alone; IO and FORMAT, by the file's name. */
StippleStatus stipple_views_read(const StippleViews* views, uint64_t index, const StippleViewBuffers* buffers);
/* Reads the points. Either pointer may be NULL. capacity: points that each has room for. Out: [N,3], as in
 * StippleViewPoints. */
StippleStatus stipple_views_read_points(const StippleViews* views, uint64_t capacity, float* positions,
                                        float* colours);

/* ---- accuracy ---------------------------------------------------------------------------------- */

/* How exact an image is, and how long it may take. A level sets every knob; the knobs may then be changed one
 * by one. stipple_accuracy_knob_info says how far off each may be, in words for people:
 *   order           unbounded: where splats cross, centre shows one of them in front as a whole
 *   projection      unbounded: affine grows with the angle that a splat fills and its distance from the axis
 *   min_alpha       each splat below x takes at most x of a pixel's colour with it, N of them 1 - (1 - x)^N
 *   sh_degree_limit unbounded: at most the sum of what the left out harmonics can add to a splat's colour
 *   antialiasing    no error but another filter: mip and samples show what as-trained aliases
 *   precision       float: within 1e-4 of the largest colour where no threshold falls on the other side; double:
 *                   rounding of the result, 6e-8
 *   budget_share    unbounded: splats are merged, the smallest change first
 *   level           all but reference end a pixel at a transmittance of 1e-4 (at most 1e-4 of the largest colour)
 *                   and hold alpha to 0.99 (0.01 of the colours behind, for each splat) */
typedef enum StippleAccuracyLevel {
  STIPPLE_ACCURACY_DRAFT = 0,    /* a quarter of the splats, colours of degree 1 */
  STIPPLE_ACCURACY_PREVIEW = 1,  /* half of the splats, colours of degree 2 */
  STIPPLE_ACCURACY_FINAL = 2,    /* all of them, as splats are trained */
  STIPPLE_ACCURACY_REFERENCE = 3 /* what the others are compared with: exact rays and order, no limit, in double */
} StippleAccuracyLevel;

typedef enum StippleSplatOrder {
  STIPPLE_ORDER_CENTRE = 0, /* by the view z of the centres */
  STIPPLE_ORDER_PIXEL = 1   /* by where behind each pixel a splat is densest: right where splats cross, nothing
                               pops when the camera rotates */
} StippleSplatOrder;

typedef enum StippleProjection {
  STIPPLE_PROJECTION_AFFINE = 0, /* ellipses, as splats are trained */
  STIPPLE_PROJECTION_RAY = 1     /* what each pixel's ray meets: right at wide angles and close by */
} StippleProjection;

typedef enum StippleSampling {
  STIPPLE_SAMPLING_AS_TRAINED = 0, /* low_pass of the render options */
  STIPPLE_SAMPLING_MIP = 1,        /* 0.1 px^2 with compensation: right when zoomed out */
  STIPPLE_SAMPLING_SAMPLES = 2     /* the image is drawn at samples_per_side times the size, and averaged by area
                                      as it is composited */
} StippleSampling;

typedef enum StipplePrecision {
  STIPPLE_PRECISION_FLOAT = 0,
  STIPPLE_PRECISION_DOUBLE = 1
} StipplePrecision;

typedef struct StippleAccuracy {
  uint32_t struct_size;
  uint32_t level;            /* StippleAccuracyLevel. Reference: also without any limit of alpha and transmittance;
                                it needs order pixel, projection ray and precision double */
  uint32_t order;            /* StippleSplatOrder */
  uint32_t projection;       /* StippleProjection */
  uint32_t antialiasing;     /* StippleSampling */
  uint32_t samples_per_side; /* 1..16; above 1 with STIPPLE_SAMPLING_SAMPLES alone */
  uint32_t sh_degree_limit;  /* 0..4; with the render options' the smaller counts */
  uint32_t precision;        /* StipplePrecision */
  double min_alpha;          /* fainter splats are skipped; above 0 and below 1; 1/255 as splats are trained */
  double budget_share;       /* the share of the splats of each cloud, above 0 to 1. Below 1 each cloud is
                                merged, once, into the nearest cloud of that size (about 3 us per splat on two
                                cores); the renderer keeps it */
} StippleAccuracy;
/* Sets every knob to what a level has. In: level, a StippleAccuracyLevel. Errors: INVALID_ARGUMENT. */
StippleStatus stipple_accuracy_init(uint32_t level, StippleAccuracy* accuracy);
/* Checks whether an image can be drawn with these knobs. Errors: INVALID_ARGUMENT, with the knob, its value and
 * what is allowed. */
StippleStatus stipple_accuracy_check(const StippleAccuracy* accuracy);

/* Texts in English; they live as long as the library. */
typedef struct StippleAccuracyKnobInfo {
  uint32_t struct_size;
  uint32_t has_bound;        /* 1: the error has the bound that the text states; 0: it has no bound */
  const char* name_utf8;     /* the field of StippleAccuracy */
  const char* label_utf8;
  const char* bound_utf8;    /* how far off the image may be, and what that costs: one or two sentences */
} StippleAccuracyKnobInfo;
StippleStatus stipple_accuracy_knob_count(uint64_t* count);
StippleStatus stipple_accuracy_knob_info(uint64_t index, StippleAccuracyKnobInfo* info);
/* "draft", "preview", "final", "reference"; NULL for others. Lives as long as the library. */
const char* stipple_accuracy_level_name(uint32_t level);
/* Says what a PSNR means to someone who looks: "looks identical" from 45 dB on, "hard to see" from 38, "visible
 * side by side" from 30, else "obvious"; never NULL. Lives as long as the library. */
const char* stipple_accuracy_verdict(double psnr);

/* ---- rendering --------------------------------------------------------------------------------- */

typedef struct StippleInstance {
  uint32_t struct_size;
  uint32_t holdout; /* 1: the instance hides what is behind it in images and leaves a hole in colour, alpha and
                       depth; not for backward passes */
  const StippleCloud* cloud;
  double matrix[16]; /* object to world; invertible */
  const StippleGrade* grade; /* read during the call; NULL: none. A grade that changes nothing costs nothing */
  double time; /* seconds, finite, 0 where nothing moves; the splats of a cloud are the same at every time */
} StippleInstance;

typedef enum StippleLowPass {
  STIPPLE_LOW_PASS_FROM_CLOUD = 0,
  STIPPLE_LOW_PASS_CLASSIC = 1,
  STIPPLE_LOW_PASS_MIP = 2,
  STIPPLE_LOW_PASS_NONE = 3
} StippleLowPass;

typedef enum StippleBlendSpace {
  STIPPLE_BLEND_AS_TRAINED = 0,  /* composite the stored colours: equals web viewers */
  STIPPLE_BLEND_SCENE_LINEAR = 1 /* linearise each splat, then composite */
} StippleBlendSpace;

typedef enum StippleOutputColour {
  STIPPLE_OUTPUT_SCENE_LINEAR = 0, /* premultiplied scene linear, as Blender and EXR want it */
  STIPPLE_OUTPUT_COMPOSITED = 1    /* the composited values as they are */
} StippleOutputColour;

typedef enum StippleRenderMethod {
  STIPPLE_RENDER_TILED = 0,
  STIPPLE_RENDER_REFERENCE = 1, /* the same in double precision, every splat at every pixel: for small images */
  /* Along the rays of the pixels, in the order in which splats are densest there: exact at wide angles and for
   * splats that are close or cross each other. Double precision, many times as slow as the first. */
  STIPPLE_RENDER_RAYS = 2,
  /* As STIPPLE_RENDER_RAYS, without any limit: no alpha is held below 1, no pixel ends early, and nothing above
   * 1e-9 is left out. The accuracy level reference draws so. */
  STIPPLE_RENDER_RAYS_UNLIMITED = 3
} StippleRenderMethod;

typedef enum StippleObjectOrder {
  STIPPLE_OBJECTS_TOGETHER = 0, /* the splats of all instances are sorted together, by depth */
  /* Each instance is drawn as a whole, its own splats by depth. Instances come by the mean depth of their
   * splats' centres (of all, in view or not), the farthest at the back; of equal ones the first in the list is
   * in front. Where no two instances share a range of depth, the image is the same either way. Not for backward
   * passes, nor, with more than one instance, with a surface, order pixel, STIPPLE_RENDER_RAYS and
   * STIPPLE_RENDER_RAYS_UNLIMITED, which order single splats: STIPPLE_ERROR_UNSUPPORTED. */
  STIPPLE_OBJECTS_APART = 1
} StippleObjectOrder;

/* The aperture of a camera, as Cycles has it: a point that is not in focus is spread over the shape of the
 * aperture. */
typedef struct StippleAperture {
  uint32_t struct_size;
  uint32_t blades;        /* 3..64: a regular polygon with its corners on the circle; 0: a circle */
  double aperture_radius; /* metres, 0 or more */
  double focus_distance;  /* metres, as depths are: there everything is sharp */
  double rotation;        /* of the polygon, radians, counterclockwise as the camera sees it */
  double ratio;           /* height over width; 0: 1 */
} StippleAperture;

/* What moves and changes while the shutter is open: matrices and splats at steps that are spread evenly over that
 * time, the first when it opens, the last when it closes. Between steps rotations of matrices are interpolated at an
 * even speed (slerp), and the rest of the matrices linearly; of splats, positions, scales, opacities and harmonics
 * linearly, row by row, and rotations the shorter way. All arrays are read during the call. */
typedef struct StippleShutter {
  uint32_t struct_size;
  uint32_t step_count;        /* 2..1025 */
  const double* cameras;      /* [steps,16] world_to_camera; NULL: the camera stands still */
  const double* instances;    /* [steps,count,16] object to world; NULL: they stand still */
  const double* curve;        /* [curve_count] 0 or more: how far it is open, at even steps; NULL: fully, always */
  uint64_t curve_count;       /* 2 or more, with curve */
  /* [steps,count] the splats of each instance, which may be freed once the call is over; NULL at a step: the
   * instance's own. All have as many splats as those, of the same degree, colour space and low-pass, in the same
   * rows. An accuracy with a budget_share below 1 merges the same splats at every step. NULL: no splat changes.
   * Cost: each image reads two clouds and writes one; memory: one cloud for each instance that changes. */
  const StippleCloud* const* clouds;
} StippleShutter;

typedef struct StippleRenderOptions {
  uint32_t struct_size;
  uint32_t method;          /* StippleRenderMethod */
  uint32_t low_pass;        /* StippleLowPass */
  uint32_t blend_space;     /* StippleBlendSpace */
  uint32_t output_colour;   /* StippleOutputColour */
  uint32_t sh_degree_limit; /* 0..4 */
  uint32_t with_background; /* 1: composite over background, alpha becomes 1 */
  uint32_t object_order;    /* StippleObjectOrder */
  double background[3];     /* in output_colour's space */
  /* A surface of something else, a mesh, between the splats. Splats whose centres are no deeper than it come
   * before it, then it with its own alpha, then the others: alpha 1 ends the pixel. As among splats, each is
   * before or behind as a whole. Pixels where no splat shows have the surface's values bit for bit. Depths
   * include it. Arrays must stay valid until the job has ended. */
  uint32_t surface_width; /* pixels; those of the camera */
  uint32_t surface_height;
  const float* surface_depth; /* [H,W] planar z, metres; 1e10 and more: behind everything. NULL: no surface */
  /* [H,W,4] premultiplied, alpha 0..1, in output_colour's space: it is added to the splats as those come out.
   * NULL: a matte, which hides what is behind it, the background too, and shows nothing itself. */
  const float* surface_colour;
  /* [H,W] 0..1, of a matte whose edges cover pixels in part. NULL: 1. With a colour: how much of what is behind it
   * the surface hides, no less than its alpha; what is hidden beyond that is a hole. NULL: its alpha. */
  const float* matte_opacity;
  /* [H,W,3] >= 0, factors of all that is not the surface, in output_colour's space: shadows that fall on
   * splats. NULL: 1. */
  const float* splat_light;
  /* How exact the image is, and how long it takes. Read during the call. NULL: as the level final. With it,
   * method must be STIPPLE_RENDER_TILED. Not for backward passes. */
  const StippleAccuracy* accuracy;
  /* What an image is averaged over. With any of these, colours and transmittance are the mean of `samples` images,
   * each from its own point of the aperture, moment of the shutter and place in the pixel, in scene linear light;
   * depths and counts are those of one more image from the middle of all. The points come from a fixed
   * low-discrepancy sequence, so that any number of threads gives the same bits. A surface takes part in every
   * image as it is: hand it in blurred, as it is to appear.
   * Cost: that of `samples` images, and 50 bytes more per pixel. */
  const StippleAperture* aperture; /* read during the call; NULL or radius 0: everything is sharp */
  const StippleShutter* shutter;   /* read during the call; NULL: nothing moves */
  uint32_t samples;                /* 1..65536; 1: the middle of all. 0: 1 without aperture and shutter, else a
                                      power of two from 16 to 256, by how far they spread the splats */
  uint32_t reserved_sampling;
  /* [H,W,3] in output_colour's space: what stands behind everything in place of background, and is composited as
   * that is; alpha becomes 1. Values that are not finite count as black. NULL: none. Must stay valid until the job
   * has ended. An average over aperture or shutter is composited over it as a whole. Not for backward passes. */
  const float* background_image;
  /* 1: the expected depth (StippleRenderBuffers.depth) is that of splats where they and the surface cover half of a
   * pixel or more, and the splats no less of it than the surface: the mean of the splats alone. Elsewhere it is the
   * surface's, or 1e10 where less than half is covered. Where no splat shows it is the surface's as given. 0: the
   * mean of all that shows, however little. */
  uint32_t solid_depth;
  uint32_t reserved_depth;
  /* [H,W,3] of all directions, in output_colour's space: each pixel shows what its ray meets in place of background. Row 0
   * is straight up (+z), the middle column looks along +y, columns further right turn towards +x. Read between four
   * pixels; composited like a background_image, which must be NULL beside it. NULL: none. Must stay valid until the
   * job has ended. Not for backward passes. */
  const float* surroundings;
  uint32_t surroundings_width;
  uint32_t surroundings_height;
} StippleRenderOptions;
void stipple_render_options_init(StippleRenderOptions* options);

/* Row 0 = top. Any pointer may be NULL. Must stay valid until the job has ended. */
typedef struct StippleRenderBuffers {
  uint32_t struct_size;
  uint32_t reserved;
  float* colour;        /* [H,W,4] premultiplied RGBA */
  float* depth;         /* [H,W] expected planar z, metres, of splats and surface; 1e10 where nothing is */
  float* median_depth;  /* [H,W] planar z where transmittance passes 1/2; 1e10 where it does not */
  uint32_t* counts;     /* [H,W] splats blended */
  float* transmittance; /* [H,W] share of the light from behind everything that passes, through holes too */
  /* [H,W,3] in the world: mean of the splats' shortest axes, on the side that faces the camera, by weight, made
   * unit again; 0 where no splat shows. Costs one more blending of the splats. */
  float* normal;
  /* [H,W] 1 + the instance whose splats weigh most together; 0 where none shows and where the surface weighs as
   * much. Costs one more blending for every three instances that meet in a tile of 16 x 16 pixels. */
  uint32_t* object_index;
} StippleRenderBuffers;

StippleStatus stipple_renderer_create(StippleContext* context, StippleRenderer** renderer);
void stipple_renderer_free(StippleRenderer* renderer);
/* Renders instances [count] together, as a job; with count 0 the image is empty.
 * Errors of the start: INVALID_ARGUMENT for a camera, matrix, surface or option outside its range; UNSUPPORTED
 * with STIPPLE_BLEND_AS_TRAINED for clouds of different colour spaces; MEMORY_LIMIT, with the numbers, before
 * anything is allocated. */
StippleStatus stipple_renderer_render_start(StippleRenderer* renderer, const StippleInstance* instances,
                                            uint64_t count, const StippleCamera* camera,
                                            const StippleRenderOptions* options,
                                            const StippleRenderBuffers* buffers, StippleJob** job);
/* Tells how many images stipple_renderer_render_start would average: samples, or what 0 stands for. Errors:
 * INVALID_ARGUMENT, as the start's. Cost: at most 2048 splats are read. */
StippleStatus stipple_renderer_sample_count(const StippleRenderer* renderer, const StippleInstance* instances,
                                            uint64_t count, const StippleCamera* camera,
                                            const StippleRenderOptions* options, uint32_t* samples);
StippleStatus stipple_renderer_memory_bound(const StippleRenderer* renderer,
                                            const StippleInstance* instances, uint64_t count,
                                            const StippleCamera* camera, uint64_t* bytes);

/* ---- what accuracy costs --------------------------------------------------------------------------- */

typedef struct StippleAccuracyReport StippleAccuracyReport; /* a view, a volume or a fit, measured */

/* What the rows of a report are settings of. */
typedef enum StippleAccuracySubject {
  STIPPLE_ACCURACY_OF_IMAGE = 0, /* judged by the reference */
  STIPPLE_ACCURACY_OF_VOLUME = 1,  /* by voxel size */
  STIPPLE_ACCURACY_OF_FIT = 2      /* by iterations */
} StippleAccuracySubject;

typedef struct StippleAccuracyMeasureOptions {
  uint32_t struct_size;
  uint32_t repetitions;       /* 1..1000, default 7: timings of each setting, which alternate, so that what else
                                 the machine does affects all alike */
  /* Pixels that are compared with the reference, default 65536; 0: all. Where the image has more, blocks of 64 x
   * 64 pixels of it, spread evenly, are compared, and the reference draws nothing else. Times are of whole
   * images. */
  uint64_t reference_pixels;
  /* Default 60. No further round of timings begins after this many seconds. Where an image of a setting in
   * double precision would take more than a twentieth of them, only the compared pixels are drawn, and its time
   * follows from those. */
  double max_seconds;
  const StippleAccuracy* settings; /* [setting_count]; NULL: the levels, and final with each knob moved alone. The
                                      reference is always there too, as the last row */
  uint64_t setting_count;
} StippleAccuracyMeasureOptions;
void stipple_accuracy_measure_options_init(StippleAccuracyMeasureOptions* options);

typedef struct StippleAccuracyReportInfo {
  uint32_t struct_size;
  uint32_t width;             /* pixels of the image */
  uint32_t height;
  uint32_t thread_count;
  uint64_t compared_pixels;
  uint64_t splat_count;       /* of all clouds */
  uint64_t row_count;
  double cut_seconds;         /* merging clouds for budget_share: once, and in no row's time */
  uint32_t subject;           /* StippleAccuracySubject; width and height are 0 of volumes and fits, thread_count of
                                 fits */
  uint32_t reserved;
} StippleAccuracyReportInfo;

typedef struct StippleAccuracyRow {
  uint32_t struct_size;
  uint32_t is_on_front;       /* 1: no other setting is as fast and as good (Pareto) */
  const char* name_utf8;      /* "preview", "final + projection ray"; lives as long as the report */
  StippleAccuracy setting;
  double seconds;             /* of an image: the median */
  double seconds_low;         /* quartiles */
  double seconds_high;
  double psnr;                /* dB, peak 1, as stipple_image_compare; infinite where nothing differs */
  double largest_error;       /* of a channel of a compared pixel */
  double error_99_9;          /* 99.9 % of the channels of compared pixels are no further off */
  uint64_t splat_count;       /* that the setting draws from */
  uint64_t visible_count;     /* of them in view */
  uint32_t repetitions;
  uint32_t is_estimated;      /* 1: seconds follow from the compared pixels; the image was not drawn whole */
  double value;               /* of a volume: voxel size, metres, splat_count its voxels that are not empty; of a fit:
                                 iterations, largest_error and error_99_9 NaN; of images 0. Of volumes and fits
                                 `setting` says nothing */
  const char* verdict_utf8;   /* what the PSNR means to who looks: "as trained", "hard to see"; lives on */
} StippleAccuracyRow;

/* Draws instances [count] from a camera at every setting, and against the reference, as a job. In: render, or NULL:
 * low-pass, blending space and background; without accuracy, surface and light.
 * Errors of the start: those of stipple_renderer_render_start; INVALID_ARGUMENT for instances without splats and for
 * options out of range. Threads and determinism: errors are the same for any number of threads.
 * Cost: the reference's compared pixels, then every setting repetitions + 1 times. docs/accuracy_and_time.md. */
StippleStatus stipple_accuracy_measure_start(StippleContext* context, const StippleInstance* instances,
                                             uint64_t count, const StippleCamera* camera,
                                             const StippleRenderOptions* render,
                                             const StippleAccuracyMeasureOptions* options, StippleJob** job);
/* Tells what the iterations of a fit cost and brought, from the report that stipple_fit_report_save has written: a
 * row for each measurement; nothing is fitted again.
 * Errors: IO; FORMAT for another file; UNSUPPORTED for a newer report; INVALID_ARGUMENT where nothing was
 * measured. */
StippleStatus stipple_fit_accuracy_report(const char* path_utf8, StippleAccuracyReport** report);
/* The result of a job of measuring that has ended well. */
StippleStatus stipple_job_accuracy_report(const StippleJob* job, StippleAccuracyReport** report);
void stipple_accuracy_report_free(StippleAccuracyReport* report);
StippleStatus stipple_accuracy_report_info(const StippleAccuracyReport* report, StippleAccuracyReportInfo* info);
/* In: index 0..row_count-1. */
StippleStatus stipple_accuracy_report_row(const StippleAccuracyReport* report, uint64_t index,
                                          StippleAccuracyRow* row);
/* Gives the row with the highest PSNR among those that take at most `seconds`. Errors: INVALID_ARGUMENT where
 * none is that fast, with what the fastest needs. */
StippleStatus stipple_accuracy_report_best_within(const StippleAccuracyReport* report, double seconds,
                                                  uint64_t* index);
/* Gives the fastest row of at least `psnr` dB. Errors: INVALID_ARGUMENT where none reaches them, with what is
 * reached. */
StippleStatus stipple_accuracy_report_cheapest_above(const StippleAccuracyReport* report, double psnr,
                                                     uint64_t* index);
/* By extension: .json (everything), .csv (a line for each row), .svg (the plot). docs/formats.md, Accuracy report.
 * Errors: IO; INVALID_ARGUMENT for another ending, and where a file that is no such report would be replaced. */
StippleStatus stipple_accuracy_report_save(const StippleAccuracyReport* report, const char* path_utf8);
/* Draws error against time, both logarithmic, with named settings and the front, as stipple_fit_report_draw
 * draws its plots; this one is 840 units wide. */
StippleStatus stipple_accuracy_report_draw(const StippleAccuracyReport* report, double scale, uint64_t capacity,
                                           float* pixels, uint32_t* width, uint32_t* height);

/* ---- meshes between splats ------------------------------------------------------------------------- */

typedef struct StippleMeshInstance {
  uint32_t struct_size;
  uint32_t reserved;
  const StippleMesh* mesh;
  double matrix[16]; /* object to world, on top of that of its parts; invertible */
} StippleMeshInstance;

/* Measures how far meshes are: planar z of the nearest triangle, from either side, that the ray through each
 * pixel's centre meets between the near and far plane.
 * Out: depth [H,W] metres, row 0 = top, 1e10 where there is none; it must stay valid until the job has ended. As a
 * matte for stipple_renderer_render_start. Same bits for any number of threads.
 * Cost: O(vertices + pixels of the triangles' bounding boxes); 24 bytes per vertex of the largest mesh.
 * Errors of the start: INVALID_ARGUMENT for a camera or matrix outside its range; MEMORY_LIMIT. */
StippleStatus stipple_mesh_depth_start(StippleContext* context, const StippleMeshInstance* instances,
                                       uint64_t count, const StippleCamera* camera, float* depth,
                                       StippleJob** job);

/* This does the same with smooth edges: each pixel is hidden as far as its samples_per_side x samples_per_side
 * samples are.
 * Out: depth [H,W] metres, that of the nearest sample, 1e10 where none hits; opacity [H,W], the share of samples
 * that do. Both must stay valid until the job has ended.
 * In: samples_per_side, 1 to 16; an image that is that many times as large may have 65,536 pixels a side.
 * Cost: as many pixels; 64 MB of samples are held at a time.
 * Errors of the start: INVALID_ARGUMENT for a camera, matrix or number of samples outside its range; MEMORY_LIMIT. */
StippleStatus stipple_mesh_matte_start(StippleContext* context, const StippleMeshInstance* instances,
                                       uint64_t count, const StippleCamera* camera, uint32_t samples_per_side,
                                       float* depth, float* opacity, StippleJob** job);

/* ---- layers of another renderer ---------------------------------------------------------------------- */

/* What another renderer drew of everything but the splats, as a surface between them, and the image of both.
 * Colours are premultiplied and scene linear. All arrays of one handle share one order of rows, whichever that is.
 * Order of calls: hold_out, take_world, take_shadow and light_before as far as each is needed; then what is read. A handle is
 * used by one thread at a time. Same bits for any number of threads. Cost of each: O(pixels). */
typedef struct StippleLayers StippleLayers;

/* Makes the layers of passes whose film was transparent.
 * In: combined [H,W,4]; depth [H,W] metres of one sample of each pixel, 1e10 or NaN where nothing is; shadow
 * [H,W,3], factors of the light of what is behind a shadow catcher that hides meshes and world, or NULL without one
 * (better: an image without catchers, and stipple_layers_take_shadow). Colours that are not
 * finite count as black.
 * Errors: INVALID_ARGUMENT for a side of 0; MEMORY_LIMIT. */
StippleStatus stipple_layers_create(StippleContext* context, uint32_t width, uint32_t height, const float* combined,
                                    const float* depth, const float* shadow, StippleLayers** layers);
void stipple_layers_free(StippleLayers* layers);
/* Takes the holdouts, of which the passes show nothing but what they leave of the rest. In: depth, opacity [H,W] as
 * of stipple_mesh_matte_start. */
StippleStatus stipple_layers_hold_out(StippleLayers* layers, const float* depth, const float* opacity);
/* Takes the light that the camera sees of the world. In: seen [H,W,3]; plain [3], its colour, or NULL where it has
 * many: what is hidden by a shadow catcher is then filled in from the pixels around. */
StippleStatus stipple_layers_take_world(StippleLayers* layers, const float* seen, const float* plain);
/* Takes the light of shadow catchers from another image than the passes, in which they hide nothing; after
 * take_world. In: shadow [H,W,3], factors of the light of what is behind a catcher, and 1 elsewhere.
 * Errors: INVALID_ARGUMENT where stipple_layers_create was given a shadow. */
StippleStatus stipple_layers_take_shadow(StippleLayers* layers, const float* shadow);
/* Leaves shadows to the splats at and behind shadow catchers. In: composited colours [H,W,4] of the splats before
 * the catchers (stipple_layers_matte), and of all; the light of each pixel is shared as these are. */
StippleStatus stipple_layers_light_before(StippleLayers* layers, const float* before, const float* whole);

typedef struct StippleLayersInfo {
  uint32_t struct_size;
  uint32_t has_light;   /* 1: surface buffers have a light */
  uint32_t has_shadows; /* 1: and it is not 1 everywhere */
  uint32_t has_opacity; /* 1: there are holdouts, and the opacity is not that of the colour */
  uint32_t width;
  uint32_t height;
} StippleLayersInfo;
StippleStatus stipple_layers_info(const StippleLayers* layers, StippleLayersInfo* info);

/* What is wanted; NULL: it is not. The arrays are those of the surface_, matte_ and splat_light fields of
 * StippleRenderOptions. */
typedef struct StippleLayersBuffers {
  uint32_t struct_size;
  uint32_t reserved;
  float* depth;   /* [H,W] metres. A pixel that a mesh covers in part has the nearest depth among itself and its
                     neighbours that a mesh covers: its one sample may have missed the mesh */
  float* colour;  /* [H,W,4] of meshes alone */
  float* light;   /* [H,W,3] factors of the splats; INVALID_ARGUMENT without has_light */
  float* opacity; /* [H,W] how much meshes and holdouts hide */
} StippleLayersBuffers;
StippleStatus stipple_layers_surface(const StippleLayers* layers, const StippleLayersBuffers* buffers);
/* Gives meshes and holdouts as a matte, with shadow catchers `margin` metres nearer than they are: nothing
 * behind a catcher is left. In: catcher_depth [H,W]. Out: depth, opacity [H,W]. */
StippleStatus stipple_layers_matte(const StippleLayers* layers, const float* catcher_depth, float margin,
                                   float* depth, float* opacity);
/* Makes the image of meshes, splats and world. In and out: colour [H,W,4] and depth [H,W] of splats that were
 * drawn with the surface between them. In: transmittance [H,W] of that image. */
StippleStatus stipple_layers_compose(const StippleLayers* layers, float* colour, float* depth,
                                     const float* transmittance);

/* ---- effects that an image needs ---------------------------------------------------------------- */

#define STIPPLE_EFFECT_COUNT 12u

/* Rows of a plan, in this order. */
typedef enum StippleEffect {
  STIPPLE_EFFECT_VIEW_COLOUR = 0,       /* colours that change with the view */
  STIPPLE_EFFECT_MOTION = 1,            /* something moves while the shutter is open */
  STIPPLE_EFFECT_MOTION_BLUR = 2,       /* and that shows */
  STIPPLE_EFFECT_DEPTH_OF_FIELD = 3,
  STIPPLE_EFFECT_EXACT_PROJECTION = 4,  /* along rays: panoramas, wide angles, splats close by */
  STIPPLE_EFFECT_ZOOM_ANTIALIASING = 5, /* splats smaller than pixels keep their light */
  STIPPLE_EFFECT_TRANSPARENT_FILM = 6,
  STIPPLE_EFFECT_DEPTH_PASS = 7,
  STIPPLE_EFFECT_NORMAL_PASS = 8,
  STIPPLE_EFFECT_OBJECT_INDEX_PASS = 9,
  STIPPLE_EFFECT_MESH_OCCLUSION = 10,
  STIPPLE_EFFECT_GLOBAL_ORDER = 11      /* splats of several objects sorted together */
} StippleEffect;

/* The choice of an effect that no switch of a scene decides. */
typedef enum StippleEffectChoice {
  STIPPLE_EFFECT_AUTO = 0,
  STIPPLE_EFFECT_ON = 1,
  STIPPLE_EFFECT_OFF = 2
} StippleEffectChoice;

/* What splats and a camera tell about effects. An "unusual" splat is beyond 99 % of what is seen, where each
 * splat counts by the area that it covers, times its opacity. */
typedef struct StippleEffectsSurvey {
  uint32_t struct_size;
  uint32_t sh_degree;      /* the largest of the clouds */
  uint64_t splat_count;
  uint64_t inspected_count;   /* splats that were inspected: 131,072 at most, evenly over all */
  uint64_t seen_count;     /* how many of those are in the image */
  uint64_t object_count;   /* instances with splats */
  uint64_t mixed_count;    /* instances whose range of depths meets that of another: all depths are read */
  double view_change[5];   /* [degree] root mean square over all directions of what its harmonics add to a colour */
  double affine_error_px;  /* how far the affine projection moves what shows of an unusual splat; a bound */
  double error_ahead_px;   /* what it would be in the middle of the image */
  double field_of_view;    /* radians, across the wider diagonal; 0 for models that are not perspective */
  double widening;         /* area of the splats with the low-pass that they were made for over that without */
} StippleEffectsSurvey;

/* Inspects splats.
 * In: instances [count], as for a render. Out: survey. Errors: INVALID_ARGUMENT as of a render.
 * Threads and determinism: the call returns when all is done; the result is the same for any number of threads.
 * Cost: O(131,072), tens of milliseconds; with several instances also a pass over all positions. */
StippleStatus stipple_effects_survey(StippleContext* context, const StippleInstance* instances, uint64_t count,
                                     const StippleCamera* camera, StippleEffectsSurvey* survey);

typedef struct StippleEffectFacts {
  uint32_t struct_size;
  uint32_t view_colour;       /* StippleEffectChoice */
  uint32_t exact_projection;  /* StippleEffectChoice */
  uint32_t zoom_antialiasing; /* StippleEffectChoice */
  uint32_t global_order;      /* StippleEffectChoice */
  uint32_t camera_model;      /* StippleCameraModel */
  uint32_t motion_blur;       /* 1: switched on in the scene */
  uint32_t camera_moves;      /* 1: while the shutter is open */
  uint64_t moving_objects;    /* instances of splats that move while it is */
  double shutter_frames;      /* how long it is open */
  uint32_t depth_of_field;    /* 1: switched on in the camera */
  uint32_t transparent_film;
  uint32_t depth_pass;
  uint32_t normal_pass;
  uint32_t object_index_pass;
  uint32_t reserved;
  double aperture_radius;     /* metres */
  double focus_distance;      /* metres */
  uint64_t hiding_meshes;     /* that stand between splats */
  double view_share;          /* 0..1 of the change of colour with the view that is kept; default 0.999 */
  double largest_error_px;    /* of the affine projection before the exact one is needed; default 1 */
  double largest_widening;    /* before anti-aliasing for all zooms is needed, >= 1; default 2 */
  double seconds[12];         /* [effect] measured by the caller; NaN, the default: not measured */
  const StippleEffectsSurvey* survey; /* NULL: there was no survey; Auto then keeps what the image might need */
} StippleEffectFacts;
void stipple_effect_facts_init(StippleEffectFacts* facts);

typedef struct StippleEffectRow {
  uint32_t struct_size;
  uint32_t effect;    /* StippleEffect */
  uint32_t is_on;
  uint32_t sh_degree; /* of VIEW_COLOUR: harmonics up to here are needed; else 0 */
  double seconds;     /* as in the facts */
  char reason[256];   /* one sentence in UTF-8, without a full stop */
} StippleEffectRow;

/* Decides which effects an image needs, and gives one row for each.
 * In: capacity, rows that there is room for; rows[0].struct_size must be set and is that of all.
 * Errors: INVALID_ARGUMENT for a fact outside its range, BUFFER_TOO_SMALL. Cost: none. */
StippleStatus stipple_effects_plan(const StippleEffectFacts* facts, StippleEffectRow* rows, uint64_t capacity);

/* ---- drawing by a graphics card ------------------------------------------------------------------ */

/* A view that moves is drawn by the graphics card: it projects the splats and blends them back to front, in an
 * order that a worker makes. Geometry goes to the card once per cloud, order and colours once per order. */

/* Floats per splat of stipple_cloud_pack: x, y, z, opacity | w, x, y, z | scales, 0. */
#define STIPPLE_DRAW_GEOMETRY_FLOATS 12u
/* Floats per splat of StippleDrawOrderBuffers.rows. */
#define STIPPLE_DRAW_ROW_FLOATS 4u
/* Rows are numbered in float32, exactly up to here. */
#define STIPPLE_MAX_DRAW_ROWS 16777216u

/* Packs the geometry of all splats of a cloud for a float texture. In: capacity, splats that geometry [N,12] has
 * room for. Errors: BUFFER_TOO_SMALL. Cost: O(N), memory bandwidth. */
StippleStatus stipple_cloud_pack(const StippleCloud* cloud, float* geometry, uint64_t capacity);

/* Must stay valid until the job has ended. N counts the splats of all instances. */
typedef struct StippleDrawOrderBuffers {
  uint32_t struct_size;
  uint32_t sh_degree_limit;   /* 0..4: harmonics above are left out of the rows' colours */
  uint64_t capacity;          /* splats that each given buffer has room for */
  uint32_t* order;            /* [N] splats back to front, counted through the instances; or NULL */
  float* rows;                /* [N,4] the same order: row of the geometry, number of the instance, and the
                                 colour C (display values, from this camera) in two numbers: with
                                 c = round(65535 sqrt(C / 64)) they are 256 r + floor(g / 256) and
                                 65536 (g mod 256) + b; or NULL */
  const uint64_t* first_rows; /* [count] row of each instance's splat 0; instances of one cloud may share
                                 them; needed with rows */
} StippleDrawOrderBuffers;

/* Orders the splats of instances [count] together, as a job. Of the camera only model and world_to_camera
 * count; splats behind it are there too. The exact reverse of the order in which stipple_renderer_render_start
 * blends: view z of the centre as float32, ties by index. Matrices may be singular (an object scaled to zero).
 * Errors of the start: INVALID_ARGUMENT for a value that is not finite, a row above STIPPLE_MAX_DRAW_ROWS;
 * BUFFER_TOO_SMALL; MEMORY_LIMIT. Nothing is written unless the job ends well.
 * Threads and determinism: the same bits for any number of threads. Cost: O(N); 32 bytes per splat, which the
 * renderer keeps for the next order. Benchmark viewport.sort. */
StippleStatus stipple_renderer_order_start(StippleRenderer* renderer, const StippleInstance* instances,
                                           uint64_t count, const StippleCamera* camera,
                                           const StippleDrawOrderBuffers* buffers, StippleJob** job);
/* Bytes that it allocates at most, beside the caller's buffers. */
StippleStatus stipple_renderer_order_memory_bound(const StippleRenderer* renderer,
                                                  const StippleInstance* instances, uint64_t count,
                                                  uint64_t* bytes);

/* ---- editing splat clouds ---------------------------------------------------------------------- */

/* Masks say for each splat of a cloud 1 (keep) or 0. They are the caller's, [mask_count] bytes where mask_count
 * must be the cloud's count, compose by AND, and go into a cloud by stipple_cloud_keep. */

typedef enum StippleSide {
  STIPPLE_SIDE_INSIDE = 0, /* keep what is inside */
  STIPPLE_SIDE_OUTSIDE = 1
} StippleSide;

/* Selects splats by their centres. cloud_to_box: affine and invertible, into the frame in which the box is the
 * cube from -1 to 1. Out: mask; kept_count, or NULL. */
StippleStatus stipple_cloud_select_box(const StippleCloud* cloud, const double cloud_to_box[16], uint32_t side,
                                       uint8_t* mask, uint64_t mask_count, uint64_t* kept_count);
/* Selects splats by the winding number of a mesh at their centres (>= 1/2 is inside): closed or nearly closed,
 * faces either way, parts may overlap. cloud_to_mesh: affine and invertible, into the world of the mesh. mask
 * and kept_count must stay valid until the job has ended; they are written at its end. */
StippleStatus stipple_cloud_select_mesh_start(const StippleCloud* cloud, const double cloud_to_mesh[16],
                                              const StippleMesh* mesh, uint32_t side, uint8_t* mask,
                                              uint64_t mask_count, uint64_t* kept_count, StippleJob** job);

typedef struct StippleFloaterOptions {
  uint32_t struct_size;
  uint32_t by_opacity;       /* 1: the rule is on (default), 0: off; each rule reads what those before it left */
  uint32_t by_size;
  uint32_t by_connectivity;
  double min_opacity;        /* 0..1, default 0.02; fainter splats go */
  double max_size;           /* metres, largest standard deviation; 0 (default): from the cloud's own sizes */
  double radius;             /* metres; splats this near to each other are connected; 0 (default): from their
                                distances */
  uint64_t min_group_count;  /* smaller groups go, the largest stays; 0 (default): N / 1000, 10 to 1000 */
} StippleFloaterOptions;
void stipple_floater_options_init(StippleFloaterOptions* options);

typedef struct StippleFloaterReport {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t faint;            /* found by opacity */
  uint64_t large;            /* of the rest, by size */
  uint64_t isolated;         /* of the rest, by connectivity */
  uint64_t kept;             /* the four add up to the cloud's count */
  uint64_t group_count;
  double max_size;           /* as used; 0 where the rule was off */
  double radius;
  uint64_t min_group_count;
} StippleFloaterReport;

/* mask: 0 for floaters. mask and report (struct_size set, or NULL) must stay valid until the job has ended;
 * they are written at its end. Cost: O(N log N). */
StippleStatus stipple_cloud_select_floaters_start(const StippleCloud* cloud,
                                                  const StippleFloaterOptions* options, uint8_t* mask,
                                                  uint64_t mask_count, StippleFloaterReport* report,
                                                  StippleJob** job);
/* Gives the splats whose mask is not 0, in their order, bit for bit. */
StippleStatus stipple_cloud_keep(const StippleCloud* cloud, const uint8_t* mask, uint64_t mask_count,
                                 StippleCloud** kept);
/* Thins a cloud that has no tree: exactly count splats, 0 to all, stay, chosen by random numbers keyed by (seed,
 * index) alone, in their order, each axis longer by the cube root of all / count, so that their volume stays; bit
 * for bit where all stay. A smaller count is a part of a larger one, and frames of a series whose splats keep
 * their places thin alike. A tree's cut (stipple_model_from_cloud_start) looks better.
 * Errors: INVALID_ARGUMENT where count is above the cloud's. Cost: O(N). */
StippleStatus stipple_cloud_thin(const StippleCloud* cloud, uint64_t count, uint64_t seed,
                                 StippleCloud** thinned);
/* Gives the hierarchy of a cloud without the splats whose mask is 0: no budget shows any of them, and its largest
 * budget is what is left, bit for bit. Of splats that move, gives those that are left, at all times. mask [mask_count], mask_count = leaf_count of the model.
 * Errors: UNSUPPORTED for a model whose settings have no takes_mask; INVALID_ARGUMENT for a mask that keeps
 * nothing.
 * Cost: O(N). */
StippleStatus stipple_model_keep(const StippleModel* model, const uint8_t* mask, uint64_t mask_count,
                                 StippleModel** kept);
/* Makes one cloud of instances [count >= 1], each moved by its matrix (stipple_cloud_transform; the identity keeps
 * every bit) with its grade baked in, harmonics padded to the highest degree. frame: StippleFrame that the
 * matrices lead to, the label of the result.
 * Errors: UNSUPPORTED where colour spaces or antialias flags differ. */
StippleStatus stipple_cloud_merge(const StippleInstance* instances, uint64_t count, uint32_t frame,
                                  StippleCloud** merged);

typedef struct StippleGroundPlaneOptions {
  uint32_t struct_size;
  uint32_t reserved;
  double up[3];      /* roughly upwards in the world, default 0 0 1; 0 0 0: unknown */
  double max_tilt;   /* radians between up and the plane's normal, default pi/4, up to pi/2 */
  double tolerance;  /* metres from the plane; 0 (default): 0.5 % of the cloud's extent */
  uint64_t seed;
} StippleGroundPlaneOptions;
void stipple_ground_plane_options_init(StippleGroundPlaneOptions* options);

typedef struct StippleGroundPlane {
  uint32_t struct_size;
  uint32_t reserved;
  double normal[3];            /* unit, upwards; points p of the plane have normal . p = offset */
  double offset;
  double matrix[16];           /* rigid: levels the plane to z = 0 by the smallest rotation */
  uint64_t considered_count;   /* splats that were inspected, at most 50,000 */
  uint64_t inlier_count;       /* of those, in the plane */
  double tolerance;            /* as used */
  /* The box of the inspected splats' middle 98 % along each axis of the levelled frame, metres: floaters count
   * for nothing. */
  double extent_min[3];
  double extent_max[3];
} StippleGroundPlane;

/* Finds the plane in which most of the surface lies, with little below it, by random samples (the same for a
 * seed). cloud_to_world: the frame of `up` and of the result. Errors: INVALID_ARGUMENT where no plane is found. */
StippleStatus stipple_cloud_ground_plane(const StippleCloud* cloud, const double cloud_to_world[16],
                                         const StippleGroundPlaneOptions* options, StippleGroundPlane* plane);
/* Gives the rigid matrix that levels the plane through three points [3,3] to z = 0, with `up` upwards. */
StippleStatus stipple_level_points(const double points[9], const double up[3], double matrix[16]);
/* Gives the uniform scale about the origin that makes the distance of two points [2,3] the given length, metres. */
StippleStatus stipple_scale_points(const double points[6], double length, double matrix[16]);

/* ---- selecting splats by regions, and filling holes --------------------------------------------- */

/* A selection says for each splat of a cloud 1 (selected) or 0. Regions, applied to it in order, make another one:
 * a function of the cloud, the regions and the selection before, and of nothing else. Splats are judged by their
 * centres, in double. */

typedef enum StippleRegionKind {
  STIPPLE_REGION_ALL = 0,    /* every splat */
  STIPPLE_REGION_BRUSH = 1,  /* at most `radius` pixels from the path `points` */
  STIPPLE_REGION_LASSO = 2,  /* inside the outline `points`, which closes itself; even-odd where it crosses itself */
  STIPPLE_REGION_SPHERE = 3, /* at most `radius` from `centre`, in the frame that `cloud_to_box` leads to */
  STIPPLE_REGION_COLOUR = 4, /* colours within `tolerance` of `colour`, everywhere or in a sphere */
  STIPPLE_REGION_GROW = 5,   /* the selection before, grown or shrunken by `distance` */
  STIPPLE_REGION_BOX = 6     /* the cube -1..1 of the frame that `cloud_to_box` leads to */
} StippleRegionKind;

typedef enum StippleRegionOperation {
  STIPPLE_REGION_SET = 0,      /* the region alone is selected */
  STIPPLE_REGION_ADD = 1,
  STIPPLE_REGION_SUBTRACT = 2,
  STIPPLE_REGION_INTERSECT = 3,
  STIPPLE_REGION_TOGGLE = 4    /* what was selected in the region is not, and the other way round */
} StippleRegionOperation;

/* What a kind does not name is not read. All kinds but GROW may be limited to what is in front. */
typedef struct StippleRegion {
  uint32_t struct_size;
  uint32_t kind;                /* StippleRegionKind */
  uint32_t operation;           /* StippleRegionOperation */
  uint32_t shrink;              /* grow: 1: the selection shrinks by `distance` */
  double cloud_to_pixels[16];   /* brush, lasso, front only: a centre (x, y, z, 1) becomes (X, Y, -, W), its pixel
                                   (X/W, Y/W), y downwards; W <= 0 is behind the camera and in no such region */
  double cloud_to_depth[4];     /* front only: depth along the view axis, dot((x, y, z, 1)), cloud units */
  const float* points;          /* [point_count,2] pixels */
  uint64_t point_count;         /* brush: 1 to 65536, lasso: 3 to 16384 */
  double radius;                /* brush: pixels; sphere, colour: units of that frame, colour: 0 is everywhere;
                                   >= 0 */
  const float* depths;          /* front only: depths [depth_height,depth_width] of what is seen, top row first,
                                   cloud units, infinity where nothing is; NULL: through */
  uint32_t depth_width;
  uint32_t depth_height;
  double depth_rect[4];         /* x0, y0, x1, y1: pixels that `depths` cover; what projects elsewhere is not seen */
  double depth_margin;          /* a splat passes where its depth is at most the image's and this; cloud units */
  double centre[3];             /* sphere, colour: in the frame that `cloud_to_box` leads to */
  double colour[3];             /* linear Rec.709, as stipple_region_colours gives it */
  double tolerance;             /* colour: distance in OKLab, 0 and above; 0.1 is a family of one hue */
  double cloud_to_box[16];      /* sphere, colour, box: affine and invertible; stipple_region_init: the identity,
                                   so that spheres lie in the space of the cloud */
  double distance;              /* grow: cloud units; 0: the median distance of selected splats to their 8th
                                   neighbour; negative: the selection shrinks by so much, too */
} StippleRegion;
void stipple_region_init(StippleRegion* region);

/* Applies regions [region_count] in order. In and out: mask, the selection before and after, [mask_count] bytes
 * where mask_count must be the cloud's count; anything but 0 counts as selected before. Out: selected_count, or
 * NULL. Errors: INVALID_ARGUMENT for a path without points, an outline of fewer than three, a number that is not
 * finite, a negative radius or tolerance, a mask of another length, an image of depths without size.
 * Cost: O(N) for each region; a million splats take 5 to 40 ms on two idle cores, GROW longer. */
StippleStatus stipple_cloud_select_regions(const StippleCloud* cloud, const StippleRegion* regions,
                                           uint64_t region_count, uint8_t* mask, uint64_t mask_count,
                                           uint64_t* selected_count);
/* Gives the centres of selected splats for drawing: all of them, or max_count that are evenly spread over their
 * indices. Out: positions [max_count,3]; written_count, of which as many rows are written. */
StippleStatus stipple_cloud_selected_positions(const StippleCloud* cloud, const uint8_t* mask, uint64_t mask_count,
                                               uint64_t max_count, float* positions, uint64_t* written_count);
/* Gives the colours that STIPPLE_REGION_COLOUR compares, linear Rec.709 of degree 0, of the splats indices [count].
 * Out: colours [count,3]. */
StippleStatus stipple_region_colours(const StippleCloud* cloud, const uint64_t* indices, uint64_t count,
                                     double* colours);

typedef struct StippleFillOptions {
  uint32_t struct_size;
  uint32_t reserved;
  double radius;      /* removed splats this near to each other are one hole, cloud units; 0 (default): from the
                         distances of the removed splats, as floaters are grouped */
  double ring_width;  /* how far from a hole splats are copied, cloud units; 0 (default): from the size of the hole */
  double patch_size;  /* side of what is copied at once, cloud units; 0 (default): from the size of the hole */
  uint64_t seed;      /* of the choice among patches that fit equally */
} StippleFillOptions;
void stipple_fill_options_init(StippleFillOptions* options);

typedef struct StippleFillReport {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t hole_count;      /* groups of removed splats */
  uint64_t filled_count;    /* of those, filled */
  uint64_t no_ring_count;   /* not filled: fewer than 16 splats are left around them */
  uint64_t no_plane_count;  /* not filled: what is left around them spans no plane */
  uint64_t covered_count;   /* not filled: nothing is missing of the ground under them; the four add up to holes */
  uint64_t splat_count;     /* new splats */
  double radius;            /* as used */
} StippleFillReport;

/* Fills holes: for each group of removed splats (mask 1, [mask_count] = the cloud's count) a plane is laid through
 * what is left around it, and its footprint on that plane is covered by patches copied from there, with their
 * heights over the plane. The job's cloud (stipple_job_cloud) has the new splats alone; it may be empty. mask is
 * read before this returns; report (struct_size set, or NULL) must stay valid until the job has ended, it is
 * written at its end. Errors: INVALID_ARGUMENT for a mask of another length and one that removes nothing or all.
 * Determinism: by the seed. Cost: O(N log N). */
StippleStatus stipple_cloud_fill_start(const StippleCloud* cloud, const StippleFillOptions* options,
                                       const uint8_t* mask, uint64_t mask_count, StippleFillReport* report,
                                       StippleJob** job);

/* ---- splats that a mesh carries ----------------------------------------------------------------- */

/* What a splat that is bound to a mesh follows. */
typedef enum StippleBindingReach {
  STIPPLE_BIND_SURFACE = 0, /* the nearest triangle: splats that lie on the mesh stay where they are on it */
  STIPPLE_BIND_AROUND = 1   /* several near triangles, smoothly: scans inside a cage or near a mesh */
} StippleBindingReach;

typedef struct StippleBindingInfo {
  uint32_t struct_size;
  uint32_t influences;     /* triangles that each splat follows */
  uint64_t splat_count;
  uint64_t vertex_count;   /* of the mesh */
  uint64_t triangle_count;
  uint64_t topology;       /* equal for meshes of as many vertices and the same triangles */
} StippleBindingInfo;

/* Binds the splats of a cloud to a mesh at rest, as a job (stipple_job_binding). In: rest [vertex_count,3] in the frame
 * of the cloud, triangles [triangle_count,3]; both are read before this returns; reach, StippleBindingReach. Errors:
 * INVALID_ARGUMENT for places that are not finite, indices out of range, a mesh without a triangle of some area;
 * MEMORY_LIMIT. Cost: O(N log T). */
StippleStatus stipple_cloud_bind_start(const StippleCloud* cloud, const float* rest, uint64_t vertex_count,
                                       const uint32_t* triangles, uint64_t triangle_count, uint32_t reach,
                                       StippleJob** job);
void stipple_binding_free(StippleBinding* binding);
StippleStatus stipple_binding_info(const StippleBinding* binding, StippleBindingInfo* info);
/* Gives the splats as the deformed mesh carries them, in the same order: places follow their triangles, shapes stretch
 * with them as far as ten times each way, harmonics turn, opacities and colours stay. In: the cloud that was bound, or
 * one of as many splats in the same places; deformed [vertex_count,3]. Errors: INVALID_ARGUMENT for another number of
 * splats or of vertices and for places that are not finite; MEMORY_LIMIT. Cost: O(N). */
StippleStatus stipple_cloud_carry(const StippleCloud* cloud, const StippleBinding* binding, const float* deformed,
                                  uint64_t vertex_count, StippleCloud** carried);

/* The mesh at rest that an asset file of any kind brings for its splats to follow. All 0: it brings none. */
typedef struct StippleRestInfo {
  uint32_t struct_size;
  uint32_t reach;          /* StippleBindingReach */
  uint64_t vertex_count;
  uint64_t triangle_count;
  uint64_t topology;       /* as of StippleBindingInfo */
} StippleRestInfo;

/* Writes an asset file once more, to out_utf8, with a mesh at rest in the place of an earlier one; both may be the same
 * file. In: positions [vertex_count,3] in the frame of the splats, triangles [triangle_count,3]; reach,
 * StippleBindingReach. Everything else in the file stays as it is. Errors: IO, FORMAT, INVALID_ARGUMENT for a mesh
 * without faces, indices out of range and places that are not finite; UNSUPPORTED for checkpoints. */
StippleStatus stipple_asset_bind(StippleContext* context, const char* path_utf8, const float* positions,
                                 uint64_t vertex_count, const uint32_t* triangles, uint64_t triangle_count,
                                 uint32_t reach, const char* out_utf8);
/* Errors: IO, FORMAT. */
StippleStatus stipple_asset_rest_info(StippleContext* context, const char* path_utf8, StippleRestInfo* info);
/* Reads that mesh. Either array may be NULL; positions has room for vertex_capacity * 3 numbers, triangles for
 * triangle_capacity * 3. Nothing is written where the file has none. Errors: IO, FORMAT, BUFFER_TOO_SMALL. */
StippleStatus stipple_asset_read_rest(StippleContext* context, const char* path_utf8, uint64_t vertex_capacity,
                                      float* positions, uint64_t triangle_capacity, uint32_t* triangles);

/* ---- differentiable rendering ------------------------------------------------------------------- */

/* The derivative of a scalar loss by the image, and what statistics need. Each array is an image of the camera's
 * size, row 0 = top; it is NULL where it is not wanted. Values are finite and at most 1e4 in size. */
typedef struct StippleBackwardInput {
  uint32_t struct_size;
  uint32_t reserved;
  const float* colour_gradient;  /* [H,W,4] dL/d(premultiplied R,G,B,alpha); needed. With a background alpha
                                    is constant, so its derivative counts for nothing */
  const float* residual;         /* [H,W,3] image minus target, for contributions */
  const float* residual_weights; /* [H,W] >= 0, weight of each pixel in contributions; NULL: 1 */
  const float* edge_weights;     /* [H,W] for edge_weights */
  const float* errors;           /* [H,W] >= 0, for errors and largest_errors */
  const float* depth_gradient;   /* [H,W] dL/d(expected depth), per metre; NULL: none. Where nothing covers a
                                    pixel it counts for nothing; the median depth has no derivative */
} StippleBackwardInput;

/* What the loss changes by the stored values of one instance's cloud, in the object's own space. Any
 * pointer may be NULL: not wanted. Splats that do not show have zeros. A cloud that is placed twice has
 * two of these: their sum is its derivative. */
typedef struct StippleSplatGradients {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t capacity;          /* splats that every given buffer has room for */
  float* positions;           /* [N,3] per metre */
  float* rotations;           /* [N,4] by the stored unit quaternion, through its normalisation: tangent */
  float* scales;              /* [N,3] per metre */
  float* opacities;           /* [N] */
  float* sh;                  /* [N,(degree+1)^2,3] */
  /* Statistics, each only where its buffer is given; N numbers unless stated. They cost time. */
  float* contributions;       /* L1 error of the image minus the error without the splat: sum over pixels and
                                 channels of w (|R| - |R - dC|), R = residual; < 0: it is useful */
  float* blending_weights;    /* sum over pixels of T alpha */
  float* edge_weights;        /* sum of edge weight times T alpha */
  float* screen_gradients;    /* [N,2] dL/d(projected centre), per pixel */
  float* absolute_screen_gradients; /* [N,2] sum over pixels of its absolute value per axis */
  float* screen_gradient_norms;     /* sum over pixels of its length */
  float* errors;              /* sum of error times T alpha */
  float* largest_errors;      /* largest error times T alpha of one pixel */
} StippleSplatGradients;

typedef struct StippleBackwardResult {
  uint32_t struct_size;
  uint32_t reserved;
  double camera[6];      /* by a motion x' = x + omega x x + upsilon in the camera's frame: omega (radians),
                            then upsilon (metres); world_to_camera' = exp(omega, upsilon) world_to_camera */
  double background[3];  /* zeros without a background */
  uint64_t visible_count;
} StippleBackwardResult;

/* Gives the derivatives of a loss by everything that stipple_renderer_render_start draws of the same arguments, as
 * a job. The clamps of alpha at 0.99 and of colours at 0 pass no derivative; where a splat ends (alpha = 1/255),
 * where a pixel ends and the order of blending are taken as fixed.
 * In: gradients [count], one per instance; result may be NULL. The images and buffers must stay valid until the
 * job has ended.
 * Errors of the start: those of drawing; INVALID_ARGUMENT for a method other than TILED, an output that is
 * converted after compositing (choose STIPPLE_OUTPUT_COMPOSITED), and for a statistic without the image that it
 * needs; BUFFER_TOO_SMALL; MEMORY_LIMIT before anything is allocated. Of the job: INVALID_ARGUMENT for a value
 * outside its range. Nothing is written unless the job ends well.
 * Threads and determinism: the same bits for any number of threads.
 * Cost: about twice drawing, and up to half as much again with every statistic. docs/methods/rasterization.md,
 * docs/methods/leave_one_out.md. */
StippleStatus stipple_renderer_backward_start(StippleRenderer* renderer, const StippleInstance* instances,
                                              uint64_t count, const StippleCamera* camera,
                                              const StippleRenderOptions* options,
                                              const StippleBackwardInput* input,
                                              const StippleSplatGradients* gradients,
                                              StippleBackwardResult* result, StippleJob** job);
/* Bytes that it allocates at most, beside the caller's buffers. */
StippleStatus stipple_renderer_backward_memory_bound(const StippleRenderer* renderer,
                                                     const StippleInstance* instances, uint64_t count,
                                                     const StippleCamera* camera,
                                                     const StippleBackwardInput* input,
                                                     const StippleSplatGradients* gradients,
                                                     uint64_t* bytes);

typedef struct StippleImageLossOptions {
  uint32_t struct_size;
  uint32_t rendered_channels; /* 3 or 4, default 4; a fourth, alpha, takes no part and its gradient is 0 */
  uint32_t target_channels;   /* 3 or 4, default 3 */
  uint32_t reserved;
  double ssim_share;          /* lambda, 0..1, default 0.2 */
} StippleImageLossOptions;
void stipple_image_loss_options_init(StippleImageLossOptions* options);

typedef struct StippleImageLoss {
  uint32_t struct_size;
  uint32_t reserved;
  double loss; /* (1 - lambda) l1 + lambda (1 - ssim) */
  double l1;   /* weighted mean of |rendered - target| over pixels and colour channels */
  double ssim; /* 11x11 Gaussian window of sigma 1.5, which reads zeros outside the image */
} StippleImageLoss;

/* Gives the loss of trained splats and its exact gradient, on this thread and the others of the context.
 * In: rendered, target [H,W,channels] as composited, about 0..1 (at most 1e6 in size), row 0 = top; weights [H,W]
 * >= 0, or NULL: 1.
 * Out: value; gradient [H,W,rendered_channels] dL/d(rendered), or NULL: not wanted, for less than half the time;
 * it may not overlap the images.
 * Errors: INVALID_ARGUMENT for sides outside 1..65536 and for values outside their range; the gradient's buffer
 * then has no meaning. The same bits for any number of threads.
 * Cost: about 20 ns a pixel and core; 0.5 MB a thread. docs/methods/loss.md. */
StippleStatus stipple_image_loss(StippleContext* context, uint32_t width, uint32_t height,
                                 const float* rendered, const float* target, const float* weights,
                                 const StippleImageLossOptions* options, StippleImageLoss* value,
                                 float* gradient);

/* ---- fitting splats to views --------------------------------------------------------------------- */

typedef enum StippleFitModel {
  STIPPLE_FIT_EXPLICIT = 0, /* splats with parameters of their own; a strategy adds and removes them */
  STIPPLE_FIT_FIELD = 1,    /* a learned density and a field of attributes: decodes at any budget */
  STIPPLE_FIT_MOTION = 2,   /* explicit splats that move, of views with times: decodes at any time */
  STIPPLE_FIT_SCAFFOLD = 3, /* anchors with features that networks turn into splats: decodes at any budget */
  STIPPLE_FIT_RELAY = 4     /* the same at key frames of a long clip, of views with times */
} StippleFitModel;

typedef enum StippleFitQuality {
  STIPPLE_FIT_FAST = 0,
  STIPPLE_FIT_BALANCED = 1,
  STIPPLE_FIT_FINE_DETAIL = 2
} StippleFitQuality;

/* What stands behind views with alpha. Views without stand before black, or white where that is chosen. */
typedef enum StippleFitBackground {
  STIPPLE_FIT_BACKGROUND_BLACK = 0,
  STIPPLE_FIT_BACKGROUND_WHITE = 1,
  STIPPLE_FIT_BACKGROUND_RANDOM = 2 /* another colour in every step: coverage then shows, whatever the colours
                                       are */
} StippleFitBackground;

/* Whether a field has a shell for what is far away, out to 64 times the size of the scene. */
typedef enum StippleFitShell {
  STIPPLE_FIT_SHELL_AUTO = 0, /* where points or depth are known and images are opaque: close behind the walls where
                                 depth ends at them, else far out */
  STIPPLE_FIT_SHELL_ON = 1,
  STIPPLE_FIT_SHELL_OFF = 2
} StippleFitShell;

/* How two key frames share the time between them. */
typedef enum StippleKeyFrameBlend {
  STIPPLE_BLEND_KEYS_LEARNED = 0, /* by what is learned of each anchor */
  STIPPLE_BLEND_KEYS_LINEAR = 1,
  STIPPLE_BLEND_KEYS_NONE = 2,    /* the nearer one is shown alone */
  STIPPLE_BLEND_KEYS_PLATEAU = 3  /* learned, and each anchor is whole until it begins to fade */
} StippleKeyFrameBlend;

typedef struct StippleFitOptions {
  uint32_t struct_size;
  uint32_t model;              /* StippleFitModel, default explicit */
  const char* strategy_utf8;   /* how splats are added and removed: a strategy that stipple_strategy_info lists,
                                  with its settings, and parts beside or instead of its own:
                                  "adaptive(threshold=0.0003)+long_axis_split". NULL, the default:
                                  "adaptive", of motion "temporal"; of a field, as density_gradient says; a scaffold
                                  and a relay have none. Presets of explicit splats set it: "adaptive" where fast, else
                                  "improved" */
  uint64_t iterations;         /* 1..10,000,000; schedules scale with it */
  uint64_t max_splats;         /* explicit and motion: hard cap, 1..2^28 */
  uint64_t start_splats;       /* explicit and motion, of a scaffold anchors; 0, the default: all known points; of
                                  photographs that makes 30,000 with others, and has up to 15,000 others where points
                                  leave images open */
  uint64_t min_anchors;      /* field: the budgets of training, from min_anchors to max_anchors,
                                1..STIPPLE_MAX_ANCHORS; default 1,024 to what the quality says: 8,192, 16,384 or
                                32,768; scaffold: there are never more than max_anchors: 5,000, 15,000 or
                                50,000 */
  uint64_t max_anchors;
  uint32_t gaussians_per_anchor; /* field: 4, the default, to 32; scaffold: 10, the default. At an equal number of splats
                                  fewer per anchor are better and cost more: anchors are what the network works for */
  uint32_t sh_degree;          /* 0..4; 0: colour does not depend on the view */
  uint32_t antialias;          /* StippleAntialias that the splats are made for */
  uint32_t background;         /* StippleFitBackground, default random */
  uint32_t density_gradient;   /* field: 1, the default: anchors are learned by what they do to the loss */
  uint32_t jitter;             /* field: 1, the default: anchors anywhere in their cell; 0: at its centre */
  uint32_t holdout;            /* every so many-th view by name is measured and not learned from, default 8; 0:
                                  none. Where views are fewer, none is. A split that the data set names wins */
  uint32_t resume;             /* 1: goes on from checkpoint_path_utf8, which must be of the same views and
                                  options */
  uint64_t seed;
  double ssim_share;           /* 0..1 of the loss beside L1, default 0.2 */
  uint64_t image_bytes;        /* kept images, default 1 GiB, of motion 768 MiB; others are loaded when wanted */
  uint64_t measure_interval;   /* iterations between measurements; 0, the default: a twentieth of the fit, at
                                  least 100 */
  const char* checkpoint_path_utf8; /* NULL, the default: none are written */
  uint64_t checkpoint_interval; /* iterations; 0, the default: by time alone */
  double checkpoint_seconds;   /* default 60; 0: by iterations alone */
  uint64_t max_bytes;          /* the memory of the whole fit, about; 0, the default: no limit. It lowers
                                  max_splats and image_bytes as far as needed */
  uint32_t shell;              /* field: StippleFitShell, default auto */
  uint32_t coarse_to_fine;     /* explicit: 1: the first steps look at large images with fewer pixels; presets set it */
  double key_frame_spacing;    /* relay: seconds between key frames, default 1 */
  uint32_t key_frame_blend;    /* relay: StippleKeyFrameBlend, default learned */
  uint32_t growth_by_level;    /* relay: 1, the default: anchors grow late where their features are varied */
  double middle_level_rank;    /* relay: 0..1, share of anchors with less varied features than the middle level
                                  has, default 0.5 */
  double high_level_rank;      /* the same of the high level, at least as much, default 0.8 */
  double middle_level_weight;  /* relay: 0..1 of the gradients that growth begins with, default 0.25 */
  double high_level_weight;    /* the same of the high level, default 0 */
} StippleFitOptions;
void stipple_fit_options_init(StippleFitOptions* options);
/* Sets model, iterations, counts, degree and antialias as a user's choice of quality asks for; the others stay.
 * In: options->struct_size set. docs/results/fitting.md says what each costs. */
StippleStatus stipple_fit_options_preset(StippleFitOptions* options, uint32_t model, uint32_t quality);

/* Sets an option by its name and a text, as a flag of the tool and a file of settings have them: "iterations" and
 * "500", "background" and "white" (or "2"), "image_bytes" and "512MiB". A text that is kept as such (strategy,
 * checkpoint_path) stays the caller's and must live as long as the options are used; "" is none.
 * In: options->struct_size set; name_utf8: the name of an option or one of its aliases (stipple_fit_option_info);
 * - counts as _, and -- in front as nothing.
 * Errors: INVALID_ARGUMENT for another name, and for a value out of range (says which is allowed, with the name as
 * it was given). */
StippleStatus stipple_fit_options_set(StippleFitOptions* options, const char* name_utf8, const char* value_utf8);

/* What an option of a fit holds. */
typedef enum StippleFitOptionKind {
  STIPPLE_FIT_OPTION_COUNT = 0,  /* a whole number */
  STIPPLE_FIT_OPTION_NUMBER = 1, /* any number */
  STIPPLE_FIT_OPTION_BYTES = 2,  /* a whole number; texts may end in KiB, MiB or GiB */
  STIPPLE_FIT_OPTION_SWITCH = 3, /* 0 or 1 */
  STIPPLE_FIT_OPTION_CHOICE = 4, /* the place of a word in a list, from 0 on */
  STIPPLE_FIT_OPTION_TEXT = 5
} StippleFitOptionKind;

/* An option of a fit: a field of StippleFitOptions. The texts live as long as the library. */
typedef struct StippleFitOptionInfo {
  uint32_t struct_size;
  uint32_t kind;               /* StippleFitOptionKind */
  uint32_t models;             /* bits 1 << StippleFitModel: the models that it concerns; others ignore it */
  uint32_t fixed_models;       /* bits: a fit of this model that goes on needs it as it was */
  const char* name_utf8;       /* of the field, without _utf8 */
  const char* help_utf8;       /* one sentence */
  const char* choices_utf8;    /* of a choice: its words, with commas between; else empty */
  double minimum;              /* of numbers; infinity: no limit */
  double maximum;
  const char* default_utf8;    /* as stipple_fit_options_set takes it */
  const char* presets_utf8[6]; /* what stipple_fit_options_preset sets: [3 * StippleFitModel + StippleFitQuality]
                                  of the first two models; NULL: it is left alone */
  const char* aliases_utf8[3]; /* other names in settings and flags, former ones too; "" where there is none */
  double alias_units[3];       /* how much 1 is under each: 1048576 of "image_memory" */
  const char* motion_presets_utf8[3]; /* as presets_utf8, of STIPPLE_FIT_MOTION: [StippleFitQuality] */
  const char* scaffold_presets_utf8[3]; /* the same of STIPPLE_FIT_SCAFFOLD */
  const char* relay_presets_utf8[3];    /* and of STIPPLE_FIT_RELAY */
} StippleFitOptionInfo;
StippleStatus stipple_fit_option_count(uint64_t* count);
/* index 0..count-1, in the order in which settings have them. */
StippleStatus stipple_fit_option_info(uint64_t index, StippleFitOptionInfo* info);

typedef struct StippleFitFigures {
  uint32_t struct_size;
  uint32_t measured_on_training; /* 1: too few views to hold any out */
  uint64_t iteration;          /* that is done */
  uint64_t iterations;
  uint64_t splat_count;        /* drawn in the last step */
  uint64_t best_iteration;     /* of the result if the fit ended now; 0: not measured yet */
  double loss;                 /* mean of the last 50 iterations */
  double psnr;                 /* dB on measured views, last; NaN: not measured yet */
  double best_psnr;
  double seconds;              /* since the first step of this job */
  double seconds_left;         /* at the pace of the last 50 iterations */
  double estimated_seconds;    /* of the whole job, from its first 20 steps; 0 before */
  uint64_t estimated_bytes;    /* the same, of memory */
  uint64_t note_count;         /* of stipple_fit_note */
  uint64_t preview_iteration;  /* of the newest preview; 0: none yet */
  char stage[64];
  double best_moving_psnr;     /* as best_psnr, of the pixels in which something moves: where the colours of a camera
                                  that stands still differ over five frames. NaN: no such camera is measured */
} StippleFitFigures;

/* Fits splats to views, as a job. It reads the images of views as they are at the start.
 * A cancel, and an error of a step or an image, end the fit with the best that it had measured: the result can be
 * read either way (stipple_fit_cloud). Checkpoints appear under their name when they are whole; a job that ends
 * early leaves one. Where one cannot be written, that is a note and the fit goes on.
 * Errors of the start: INVALID_ARGUMENT for options out of range, an unknown strategy, views without images, of one
 * time where splats move, a checkpoint's path with a file of another kind; MEMORY_LIMIT. Of the job: INVALID_ARGUMENT for views that nothing can be learned from (no cameras, all black,
 * transparent or masked out, cameras that see none of the points); those of reading images; with resume IO,
 * FORMAT, UNSUPPORTED, and INVALID_ARGUMENT for a checkpoint of other options or views (says which).
 * Threads and determinism: the same bits for any number of threads, any image_bytes, and wherever it was stopped
 * and resumed in between. docs/methods/fitting.md. */
StippleStatus stipple_fit_start(StippleContext* context, const StippleViews* views, const StippleFitOptions* options,
                                StippleJob** job);
/* The same of explicit splats that stand still, beginning with the splats of a cloud instead of its own: all that the
 * steps do to them, density control included, begins from there. In: cloud: in the coordinates and the colour space of
 * the views; its harmonics are cut or filled up to sh_degree. start_splats counts for nothing. Errors of the start: as
 * above; INVALID_ARGUMENT for another model, a cloud without splats or with more than max_splats, another colour space;
 * MEMORY_LIMIT for more than max_bytes has room for. With resume, INVALID_ARGUMENT for a checkpoint of another start. */
StippleStatus stipple_fit_start_from(StippleContext* context, const StippleCloud* cloud, const StippleViews* views,
                                     const StippleFitOptions* options, StippleJob** job);
/* Estimates the bytes that a fit allocates: images up to image_bytes, the model at its largest, its best state
 * and a checkpoint. */
StippleStatus stipple_fit_memory_bound(const StippleViews* views, const StippleFitOptions* options,
                                       uint64_t* bytes);
/* Never waits. In: figures->struct_size set. */
StippleStatus stipple_fit_figures(const StippleJob* job, StippleFitFigures* figures);
/* Gives one sentence on something that the user should know (a view that shows nothing, a checkpoint that could
 * not be written). The text lives as long as the job. */
StippleStatus stipple_fit_note(const StippleJob* job, uint64_t index, const char** text);
/* Gives the splats as they are now, to be shown while the job runs. It never waits: it gives the newest copy,
 * and asks the job for another after the present step. Out: cloud, NULL where there is none yet. */
StippleStatus stipple_fit_preview(StippleJob* job, StippleCloud** cloud);
/* Sets whether previews tell what each splat contributes (stipple_cloud_quantity): 1, or 0, as at the begin of a
 * fit. With 1 the fit draws 8 views for every preview; its steps are the same either way. */
StippleStatus stipple_fit_watch_contributions(StippleJob* job, uint32_t watched);
/* Sets the time that previews of splats that move show, seconds; at the begin of a fit that of its clip. The next
 * preview that is asked for has it. Splats that stand still have no time. Steps are the same whatever is shown.
 * Errors: INVALID_ARGUMENT for a time that is not finite. */
StippleStatus stipple_fit_watch_time(StippleJob* job, double seconds);
/* Gives the result of a job that has ended, however it ended: the state that did best on views it learned from,
 * decoded at a budget (anchors of a field; 0: the largest; explicit splats have one size; splats that move are
 * as they are when their clip begins). INVALID_ARGUMENT
 * where no step was taken. */
StippleStatus stipple_fit_cloud(const StippleJob* job, uint64_t budget, StippleCloud** cloud);
/* Gives the result of a field, or of splats that move, as a model, which stipple_model_save writes and
 * stipple_model_decode turns into splats at any budget or time. UNSUPPORTED for explicit splats that stand still:
 * stipple_model_from_cloud_start makes a model of their cloud. */
StippleStatus stipple_fit_model(const StippleJob* job, StippleModel** model);
/* Whether a fit may write its report and its checkpoints to these places, to be asked before it starts; NULL for what
 * is not wanted. Nothing is written. Errors: IO where they cannot be written; INVALID_ARGUMENT where a file of another
 * kind would be replaced. */
StippleStatus stipple_fit_places_check(const char* report_path_utf8, const char* checkpoint_path_utf8);
/* The story of a job that has ended: JSON at path_utf8, and its curves as SVG beside it, under the same name with
 * the extension .svg. Errors: IO; INVALID_ARGUMENT where no step was taken, or a file of another kind would be replaced. */
StippleStatus stipple_fit_report_save(const StippleJob* job, const char* path_utf8);
/* Draws the same curves as an image: dark on white, with axes, titles and legends.
 * In: scale 0.25..8, pixels of a unit of the SVG, whose two columns are 960 units wide; capacity, floats of
 * pixels.
 * Out: pixels [height,width,4] display sRGB 0..1, opaque, row 0 = top, or NULL: only the size is wanted; width,
 * height.
 * Errors: INVALID_ARGUMENT where no step was taken; BUFFER_TOO_SMALL, with the size set.
 * Threads and determinism: the same bits everywhere. Cost: about 0.1 s at scale 2. */
StippleStatus stipple_fit_report_draw(const StippleJob* job, double scale, uint64_t capacity, float* pixels,
                                      uint32_t* width, uint32_t* height);

/* What can be shown of each splat, to follow density control. */
typedef enum StippleSplatQuantity {
  STIPPLE_QUANTITY_SCORE = 0,       /* [N] how much it asked to multiply at the last event, in the units of the
                                       strategy: usually thresholds, where 1 multiplies */
  STIPPLE_QUANTITY_AGE = 1,         /* [N] iterations since it was made; of densified clouds, events since then */
  STIPPLE_QUANTITY_SPLIT_AXIS = 2,  /* [N,3] the longest axis, in the cloud's frame, times 1 - second axis / longest: 0
                                       for a round splat, length 1 for a needle */
  STIPPLE_QUANTITY_CONTRIBUTION = 3 /* [N] pixels that it fills: blending weights, summed; mean of up to 16 views, 8
                                       in previews */
} StippleSplatQuantity;
/* Reads what is known of each splat of a preview or the result of a fit, or of a densified cloud; the split axis of
 * any cloud.
 * In: quantity StippleSplatQuantity; capacity, floats of values. Out: values, or NULL: only the number is wanted;
 * count, floats: 0 where nothing of the kind is known, as of clouds from elsewhere and of fields, which no strategy
 * gives scores or ages. Errors: BUFFER_TOO_SMALL, with count set. The same bits for any number of threads. */
StippleStatus stipple_cloud_quantity(const StippleCloud* cloud, uint32_t quantity, uint64_t capacity, float* values,
                                     uint64_t* count);

/* A strategy, which adds and removes splats, or a part of one. The texts live as long as the library. */
typedef struct StippleStrategyInfo {
  uint32_t struct_size;
  uint32_t model;            /* StippleFitModel that it is for */
  const char* name_utf8;     /* as StippleFitOptions::strategy_utf8 takes it */
  const char* summary_utf8;  /* one sentence for artists */
  const char* label_utf8;    /* for people: "Long Axis Split" */
  const char* decides_utf8;  /* what it decides, in words with commas between; empty for fields */
  uint32_t bit;              /* of a part, 0..30: files keep under it that the part was chosen, and no other part
                                ever gets it. STIPPLE_NO_INDEX of a strategy */
  uint32_t setting_count;    /* of stipple_strategy_setting */
} StippleStrategyInfo;
StippleStatus stipple_strategy_count(uint64_t* count);
/* index 0..count-1, in the order in which they are shown. */
StippleStatus stipple_strategy_info(uint64_t index, StippleStrategyInfo* info);
/* Parts that go into strategies of explicit splats, by "strategy+part". */
StippleStatus stipple_strategy_part_count(uint64_t* count);
StippleStatus stipple_strategy_part_info(uint64_t index, StippleStrategyInfo* info);
/* A number that can be set of a strategy or a part: "adaptive(threshold=0.0002)". */
typedef struct StippleStrategySetting {
  uint32_t struct_size;
  uint32_t is_whole;      /* 1: a count, or 0 and 1 for no and yes */
  const char* name_utf8;  /* lives as long as the library */
  double default_value;
  double minimum;
  double maximum;
} StippleStrategySetting;
/* In: name_utf8 of a strategy or a part; index 0..setting_count-1. */
StippleStatus stipple_strategy_setting(const char* name_utf8, uint64_t index, StippleStrategySetting* setting);
/* Checks whether explicit splats take this strategy. Errors: INVALID_ARGUMENT for a name or setting that is not
 * there, a part that does not go with another (says which, and what both decide), a strategy of fields. */
StippleStatus stipple_strategy_check(const char* strategy_utf8);

typedef struct StippleDensifyOptions {
  uint32_t struct_size;
  uint32_t event_count;        /* 1..1000, default 1: how often splats are added and removed */
  const char* strategy_utf8;   /* how they are; NULL: "adaptive" */
  uint64_t max_splats;         /* hard cap; 0, the default: twice as many as there are */
  uint64_t seed;
  uint64_t image_bytes;        /* images kept in memory, default 1 GiB; others are loaded when wanted */
  uint32_t holdout;            /* every so many-th view by name is left out, default 0: none. A split that the data
                                  set names wins where it is not 0 */
  uint32_t reserved;
} StippleDensifyOptions;
void stipple_densify_options_init(StippleDensifyOptions* options);

/* Does the density control of a finished cloud, as a job (stipple_job_cloud): its splats are copied, split and
 * removed as a strategy says, by what views tell of them; no parameter takes a step and no opacity is reset.
 * Splats that stay come first, in their order and bit for bit, then new ones. A fit of the result moves them to
 * their places.
 * In: views: of the cloud's colour space and frame, with images; transparent ones stand before black.
 * Errors of the start: INVALID_ARGUMENT for an empty cloud, views without images or of another colour space, a
 * strategy that is not there (says which are), options out of range; MEMORY_LIMIT. Of the job: INVALID_ARGUMENT
 * for views that show nothing; those of reading images.
 * Threads and determinism: the same bits for any number of threads.
 * Cost: for each event one drawing and one backward pass per view. docs/methods/densification.md. */
StippleStatus stipple_densify_start(StippleContext* context, const StippleCloud* cloud, const StippleViews* views,
                                    const StippleDensifyOptions* options, StippleJob** job);

typedef struct StippleDetailOptions {
  uint32_t struct_size;
  uint32_t view_count;         /* images that are looked at, spread evenly, 1..64; 0, the default: as in training */
  uint64_t max_splats;         /* of the result; 0, the default: every splat becomes finer */
} StippleDetailOptions;
void stipple_detail_options_init(StippleDetailOptions* options);

/* Adds to a coarse cloud the detail that a few views show, as a job (stipple_job_cloud), in one pass of a network:
 * the splats that matter most to the error of these views become finer ones, all others stay and come first. Views
 * are of the cloud's colour space and frame, with images; transparent ones stand before black.
 * In: weights_path: detail.safetensors of stipple_train_start. Errors of the start: IO; FORMAT for a file that is no
 * safetensors, or with tensors that are missing or not finite; INVALID_ARGUMENT for weights of others or of another
 * network, an empty cloud, views of another colour space or none, options out of range (max_splats says which numbers
 * of splats this network makes of these); MEMORY_LIMIT. Of the job: INVALID_ARGUMENT where no view shows any splat;
 * those of reading images.
 * Threads and determinism: the same bits for any number of threads. Cost: for each view three drawings and a backward
 * pass. docs/methods/generative_densification.md. */
StippleStatus stipple_detail_start(StippleContext* context, const StippleCloud* cloud, const StippleViews* views,
                                   const char* weights_path, const StippleDetailOptions* options, StippleJob** job);

/* ---- volumes ----------------------------------------------------------------------------------- */

typedef struct StippleVoxelizeOptions {
  uint32_t struct_size;
  uint32_t resolution;    /* voxels along the longest side where voxel_size is 0; default 256 */
  double voxel_size;      /* metres; 0: from resolution */
  double low_pass;        /* splats thinner than this share of a voxel are widened to it, with their optical
                             depth kept; default 0.5; 0: none */
  double cut_off_sigma;   /* default 4; <= 0: none */
  double min_density;     /* per metre; lower extinction is not stored; default 0.001 */
} StippleVoxelizeOptions;
void stipple_voxelize_options_init(StippleVoxelizeOptions* options);

typedef struct StippleVolumeInfo {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t brick_count;   /* of 8x8x8 voxels */
  uint64_t active_voxel_count;
  double voxel_size;      /* metres */
  double bounds_min[3];   /* of the bricks, metres */
  double bounds_max[3];
  double max_density;     /* per metre */
} StippleVolumeInfo;

/* Fills a volume with extinction and scene linear colour, as a job (stipple_job_volume). */
StippleStatus stipple_voxelize_start(StippleContext* context, const StippleInstance* instances,
                                     uint64_t count, const StippleVoxelizeOptions* options,
                                     StippleJob** job);
StippleStatus stipple_voxelize_memory_bound(StippleContext* context, const StippleInstance* instances,
                                            uint64_t count, const StippleVoxelizeOptions* options,
                                            uint64_t* bytes);
typedef struct StippleVolumeAccuracyOptions {
  uint32_t struct_size;
  uint32_t repetitions; /* 1..1000, default 5: timings of each voxel size, which alternate */
  double max_seconds;   /* default 60; no further round of timings begins after this many seconds */
} StippleVolumeAccuracyOptions;
void stipple_volume_accuracy_options_init(StippleVolumeAccuracyOptions* options);
/* Measures what the voxel size of a volume costs, as a job (stipple_job_accuracy_report): voxels of the size that
 * `finest` says (NULL: its defaults), then 1.5, 2, 3, 4, 6 and 8 times as large; the finest is the last row and
 * judges the others. It compares how the volumes look along their three axes, blended front to back at the pixels
 * of the finest, in display values. A cancel waits for the volume that is being filled.
 * Errors of the start: INVALID_ARGUMENT; of the job: those of stipple_voxelize_start.
 * Threads and determinism: errors are the same for any number of threads.
 * Cost: about 1.5 repetitions times that of the finest. docs/accuracy_and_time.md. */
StippleStatus stipple_volume_accuracy_start(StippleContext* context, const StippleInstance* instances,
                                            uint64_t count, const StippleVoxelizeOptions* finest,
                                            const StippleVolumeAccuracyOptions* options, StippleJob** job);
void stipple_volume_free(StippleVolume* volume);
StippleStatus stipple_volume_info(const StippleVolume* volume, StippleVolumeInfo* info);
/* Writes an OpenVDB file with the grids `density` and `color`. */
StippleStatus stipple_volume_save(const StippleVolume* volume, const char* path_utf8);
StippleStatus stipple_volume_load(StippleContext* context, const char* path_utf8, StippleVolume** volume);

typedef struct StippleVolumeToMeshOptions {
  uint32_t struct_size;
  uint32_t largest_only; /* 1: only the piece that encloses most, without hollows; default 0 */
  double opacity;        /* of one voxel, between 0 and 1, at which the surface lies; default 0.5 */
  double density;        /* the same per metre; 0, the default: from opacity, -ln(1 - opacity) / voxel size */
  double adaptivity;     /* 0..1, default 0; larger faces where the surface is flat */
} StippleVolumeToMeshOptions;
void stipple_volume_to_mesh_options_init(StippleVolumeToMeshOptions* options);

/* Makes the closed surface of a volume's density, for shadows and collisions, as a job (stipple_job_mesh). Every
 * edge has two triangles, which run against each other. Colours are not read. Same result for any number of
 * threads.
 * Errors of the start: INVALID_ARGUMENT, MEMORY_LIMIT; of the job: INVALID_ARGUMENT for an empty volume and, with
 * the largest value, for a threshold that no voxel reaches; UNAVAILABLE where libstipple_media cannot be loaded. A
 * cancel waits for the surface itself, which is one call of OpenVDB. docs/methods/proxy_mesh.md. */
StippleStatus stipple_volume_to_mesh_start(const StippleVolume* volume,
                                           const StippleVolumeToMeshOptions* options, StippleJob** job);
StippleStatus stipple_volume_to_mesh_memory_bound(const StippleVolume* volume,
                                                  const StippleVolumeToMeshOptions* options,
                                                  uint64_t* bytes);

/* ---- images ---------------------------------------------------------------------------------- */

typedef enum StippleTransfer {
  STIPPLE_TRANSFER_LINEAR = 0, /* scene linear Rec.709 */
  STIPPLE_TRANSFER_SRGB = 1    /* display sRGB */
} StippleTransfer;

typedef struct StippleImageInfo {
  uint32_t struct_size;
  uint32_t width;
  uint32_t height;
  uint32_t channels;
  uint32_t transfer; /* StippleTransfer */
  uint32_t reserved;
} StippleImageInfo;

typedef struct StippleImageComparison {
  uint32_t struct_size;
  uint32_t reserved;
  double psnr;        /* dB, peak 1; +infinity where equal. Alpha counts where either image is transparent */
  double ssim;        /* mean over pixels and colour channels, 11x11 Gaussian window */
  double max_error;
  double mean_error;
} StippleImageComparison;

/* pixels [height,width,channels], row 0 = top, premultiplied alpha. channels 1, 3 or 4. */
StippleStatus stipple_image_create(StippleContext* context, uint32_t width, uint32_t height,
                                   uint32_t channels, uint32_t transfer, const float* pixels,
                                   StippleImage** image);
StippleStatus stipple_image_load(StippleContext* context, const char* path_utf8, StippleImage** image);
void stipple_image_free(StippleImage* image);
StippleStatus stipple_image_info(const StippleImage* image, StippleImageInfo* info);
/* capacity: floats that pixels has room for. */
StippleStatus stipple_image_read(const StippleImage* image, float* pixels, uint64_t capacity);
/* Writes the format that the extension says: .exr, scene linear and premultiplied, or .png, display sRGB with
 * straight alpha; values are converted between the two unless keep_values is 1. */
StippleStatus stipple_image_save(const StippleImage* image, const char* path_utf8, uint32_t keep_values);
/* Compares two images of the same size and channels in display space. */
StippleStatus stipple_image_compare(const StippleImage* a, const StippleImage* b,
                                    StippleImageComparison* result);
/* LPIPS of two images of the same size, as a job: 0 where equal, more where people see more difference. weights_utf8: a
 * safetensors file with the state of the authors' module, of AlexNet or VGG16 (docs/methods/lpips.md); nothing is shipped.
 * Alpha is over black. *distance is written when the job is done and must live until then. Errors: IO and FORMAT for
 * the file; INVALID_ARGUMENT for images of different sizes or too small ones; OUT_OF_MEMORY; CANCELLED. */
StippleStatus stipple_image_lpips_start(const StippleImage* a, const StippleImage* b, const char* weights_utf8,
                                        double* distance, StippleJob** job);

typedef struct StippleImageChannelInfo {
  uint32_t struct_size;
  uint32_t width;
  uint32_t height;
  uint32_t reserved;
  const char* name_utf8; /* "ViewLayer.Depth.Z"; lives as long as the channels */
} StippleImageChannelInfo;

/* Reads all channels of an OpenEXR file as float32: half, float and integer channels, of any compression, scan
 * lines and tiles, one part or several. A name has its layer in front; where a part leaves that out of its channels,
 * it is the part's name. Integers keep their value as near as float32 does. What lies outside the data window is 0.
 * Errors: STIPPLE_ERROR_FORMAT for another kind of file and one that is cut off; STIPPLE_ERROR_UNSUPPORTED for deep
 * pixels; STIPPLE_ERROR_MEMORY_LIMIT, before anything is allocated, where the values would take more than the
 * context allows or than 4 GiB; STIPPLE_ERROR_UNAVAILABLE without libstipple_media.so. */
StippleStatus stipple_image_channels_load(StippleContext* context, const char* path_utf8,
                                          StippleImageChannels** channels);
void stipple_image_channels_free(StippleImageChannels* channels);
uint64_t stipple_image_channels_count(const StippleImageChannels* channels); /* 0 for NULL */
StippleStatus stipple_image_channels_info(const StippleImageChannels* channels, uint64_t index,
                                          StippleImageChannelInfo* info);
/* values [height,width], row 0 = top. capacity: floats that values has room for. */
StippleStatus stipple_image_channels_read(const StippleImageChannels* channels, uint64_t index, float* values,
                                          uint64_t capacity);

/* ---- weights of networks ----------------------------------------------------------------------- */

/* What turns an image into splats are the networks of four published files, which their users download. Nothing
 * here downloads or contains them. Their structure was verified on small networks with random weights; the published
 * files themselves have never been run by the makers of this library. */
typedef enum StippleWeightsRole {
  STIPPLE_WEIGHTS_STRUCTURE_ENCODER = 0, /* an image's structure: DINOv3 ViT-H/16+ */
  STIPPLE_WEIGHTS_COLOUR_ENCODER = 1,    /* an image's colours: the encoder of FLUX.2's autoencoder */
  STIPPLE_WEIGHTS_FLOW = 2,              /* from noise and features to a latent */
  STIPPLE_WEIGHTS_DECODER = 3            /* from a latent to splats */
} StippleWeightsRole;

typedef enum StippleWeightsState {
  STIPPLE_WEIGHTS_MISSING = 0,
  STIPPLE_WEIGHTS_OTHER_SIZE = 1,    /* the names of its tensors are right, its size is not the published one's */
  STIPPLE_WEIGHTS_UNCHECKED = 2,     /* of the published size; nobody has compared its content yet */
  STIPPLE_WEIGHTS_PUBLISHED = 3,     /* its SHA-256 is that of the published file */
  STIPPLE_WEIGHTS_OTHER_CONTENT = 4, /* its SHA-256 is another one */
  STIPPLE_WEIGHTS_TRAINED = 5,       /* of a training of ours (stipple_train_start) */
  STIPPLE_WEIGHTS_NOT_NEEDED = 6     /* an encoder of images, where the flow network was trained by us */
} StippleWeightsState;

/* Texts live as long as the handle that they were asked of. */
typedef struct StippleWeightsFile {
  uint32_t struct_size;
  uint32_t role;                      /* StippleWeightsRole */
  uint32_t state;                     /* StippleWeightsState */
  uint32_t reserved;
  uint64_t bytes;                     /* 0 where it is missing */
  uint64_t published_bytes;
  int64_t modified_ns;                /* nanoseconds since 1970 */
  const char* label_utf8;             /* what people call it */
  const char* path_utf8;              /* "" where it is missing */
  const char* published_path_utf8;    /* in the published model */
  const char* published_sha256_utf8;  /* 64 hexadecimal digits */
  const char* sha256_utf8;            /* of the file, where it was read (stipple_weights_check_start); else "" */
  const char* licence_utf8;           /* one or two sentences */
} StippleWeightsFile;

typedef struct StippleWeightsInfo {
  uint32_t struct_size;
  uint32_t file_count;     /* roles: one for each value of StippleWeightsRole, missing ones too */
  uint64_t note_count;     /* of stipple_weights_note */
  const char* folder_utf8;
  const char* source_utf8; /* where users get the files */
} StippleWeightsInfo;

/* Looks through a folder and its subfolders and tells files apart by the names of their tensors: what they are called
 * and where they lie does not matter. Reads their headers alone. folder_utf8: NULL for the context's weights folder.
 * Errors: IO for a folder that cannot be read; INVALID_ARGUMENT for one with more than 20,000 files and folders. */
StippleStatus stipple_weights_find(StippleContext* context, const char* folder_utf8, StippleWeights** weights);
void stipple_weights_free(StippleWeights* weights);
StippleStatus stipple_weights_info(const StippleWeights* weights, StippleWeightsInfo* info);
/* role: StippleWeightsRole. */
StippleStatus stipple_weights_file(const StippleWeights* weights, uint32_t role, StippleWeightsFile* file);
/* A sentence about files that cannot be read, or of which there are several. */
StippleStatus stipple_weights_note(const StippleWeights* weights, uint64_t index, const char** text_utf8);
/* Writes weights that were trained here with 16 bits for each number, the nearest to what it was: half the size. All
 * that reads weights reads them. Errors: IO, FORMAT; INVALID_ARGUMENT for weights of others, numbers above 65,504, and
 * where out_path has a file of another kind. */
StippleStatus stipple_weights_save_half_sized(const char* weights_path, const char* out_path);
/* Compares the files' SHA-256 with the published ones, as a job (stipple_job_weights). A file that this process has
 * read before, with the same path, size and time, is not read again. Cost: about 4 GB are read. */
StippleStatus stipple_weights_check_start(const StippleWeights* weights, StippleJob** job);

/* ---- splats from an image ---------------------------------------------------------------------- */

typedef enum StippleNoiseSource {
  STIPPLE_NOISE_KEYED = 0,    /* the same on every machine */
  STIPPLE_NOISE_TORCH_CPU = 1 /* what PyTorch draws on a CPU, to repeat somebody's run */
} StippleNoiseSource;

typedef struct StippleGenerateOptions {
  uint32_t struct_size;
  uint32_t steps;            /* from noise to the object, 1..1000, default 20; time grows with them */
  uint32_t token_count;      /* of the latent, 1..65536, default 8192; published networks know 1024..8192 */
  uint32_t canvas_size;      /* pixels of the image that networks see, a multiple of 16, 32..2048, default 1024 */
  uint32_t erode_radius;     /* pixels that the mask shrinks by, 0..64, default 1 */
  uint32_t noise_source;     /* StippleNoiseSource, default keyed */
  uint32_t uses_mean_colour; /* 1: no noise on what the colour encoder says; default 0 */
  uint32_t watches_layers;   /* 1: stages have every layer of the encoders too; default 0 */
  uint32_t measures_likeness; /* 1: figures say how much the object looks like the image; default 0 */
  uint32_t matches_colours;  /* 1: the object's colours are led closer to the image, and its likeness is measured;
                                default 0. Networks of stipple_train_start alone: others are refused */
  uint32_t reserved;
  uint32_t preview_steps;    /* a preview after every so many steps; 0, the default: none */
  uint64_t preview_anchors;  /* of a preview, and of the splats that the size is measured at, default 256 */
  uint64_t seed;             /* of all noise, default 42 */
  double guidance;           /* 0..100, default 3; 1 and less: half as many runs of the network */
  double shift;              /* 0.01..100, default 3; above 1 more steps are taken where there is much noise */
  double size;               /* metres, default 1: the largest side of the object, which stands on the origin with the
                                middle of its base; 0: as the networks have it */
  const char* weights_folder_utf8;  /* NULL, the default: the context's (stipple_context_set_weights_folder) */
  const char* checkpoint_path_utf8; /* NULL, the default: none. A file that keeps the state after every step; the same
                                       image, settings and weights go on from it, and others are refused. It stays */
  const StippleJob* encoded_by;     /* NULL, the default: none. Another job of stipple_generate_start: where it has
                                       encoded the same image by the same files, this one does not. It may be freed
                                       when stipple_generate_start has returned */
} StippleGenerateOptions;
void stipple_generate_options_init(StippleGenerateOptions* options);

typedef struct StippleGenerateEstimate {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t bytes;        /* of memory, about; weights are read from their files while they are used */
  uint64_t weight_bytes; /* of those files */
  double seconds;        /* about, on this machine */
  double operations;     /* multiplications and additions */
  double image_seconds;  /* those of the seconds that several seeds of an image share, see encoded_by */
} StippleGenerateEstimate;

typedef struct StippleGenerateFigures {
  uint32_t struct_size;
  uint32_t step;         /* steps that are done */
  uint32_t steps;
  uint32_t resumed_step; /* where it went on from a checkpoint; 0: it began */
  uint32_t preview_step; /* of the newest preview; 0: none yet */
  uint32_t stage_count;  /* of stipple_generate_stage */
  double seconds;
  double seconds_left;   /* by the steps that are done; 0: not known yet */
  double likeness;       /* dB: how much the object looks like the image, from wherever it looks most like it, both cut
                            out and over black; for comparing seeds. NaN: not asked for, no image, or not yet */
} StippleGenerateFigures;

/* What passed by at one place of the networks. */
typedef struct StippleGenerateStage {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t count;
  double minimum;
  double maximum;
  double mean;
  double deviation;
  double seconds;        /* from the stage before to this one */
  const char* name_utf8; /* "step3.latent"; lives as long as the job */
  double operations;     /* multiplications and additions of networks in these seconds; 0: not counted */
} StippleGenerateStage;

/* Turns the object in an image into a latent, which decodes to splats at any budget (stipple_job_model), as a job.
 * In: image: RGB or RGBA, or NULL: an object that no image tells of, another one for each seed; mask: NULL, or an image of any size that is opaque or white on the object and is used in
 * place of the image's alpha.
 * The object comes out upright (z up), its pictured side towards +x.
 * Errors: INVALID_ARGUMENT for files of weights that are missing, for an image that is opaque everywhere without a
 * mask, and for one whose mask leaves nothing; FORMAT for networks that do not fit together; MEMORY_LIMIT.
 * Threads and determinism: the same result for any number of threads.
 * Cost: stipple_generate_estimate. Source: arXiv 2605.16355 and its released code. */
StippleStatus stipple_generate_start(StippleContext* context, const StippleImage* image, const StippleImage* mask,
                                     const StippleGenerateOptions* options, StippleJob** job);
/* What such a job takes on this machine, about. The machine's speed is measured when a process asks first (a fifth of a
 * second). Errors: as stipple_generate_start, of options and weights. */
StippleStatus stipple_generate_estimate(StippleContext* context, const StippleGenerateOptions* options,
                                        StippleGenerateEstimate* estimate);
/* How a job of stipple_generate_start is doing. Never waits. */
StippleStatus stipple_generate_figures(const StippleJob* job, StippleGenerateFigures* figures);
StippleStatus stipple_generate_stage(const StippleJob* job, uint32_t index, StippleGenerateStage* stage);
/* *cloud: the newest preview, which is given once; NULL where there is no newer one. Never waits. */
StippleStatus stipple_generate_preview(StippleJob* job, StippleCloud** cloud);

/* ---- networks that are trained ---- */

/* How a training is doing. */
typedef struct StippleTrainFigures {
  uint32_t struct_size;
  uint32_t measured_on_training; /* 1: too few objects to hold any out */
  uint64_t step;             /* steps that are done, over all parts */
  uint64_t steps;
  uint64_t resumed_step;     /* where it went on from a checkpoint; 0: it began */
  uint64_t skipped_steps;    /* whose derivatives were not finite: they changed nothing */
  uint64_t object_count;     /* that are learned from */
  uint64_t held_out_count;   /* objects that judge */
  uint64_t best_step;        /* of the result if the training ended now; 0: not measured yet */
  uint64_t note_count;       /* of stipple_train_note */
  uint64_t budget_count;     /* of stipple_train_budget; 0 before the end */
  double loss;               /* means of the last 50 steps */
  double structure;          /* nats by which the density is away from the surface's, likewise */
  double psnr;               /* dB on held-out objects, last; NaN: not measured yet */
  double seconds;            /* since the first step of this job */
  double seconds_left;       /* at the pace of the last 50 steps */
  char stage[64];
} StippleTrainFigures;

/* What the networks of a training are worth at a budget. */
typedef struct StippleTrainBudget {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t anchors;
  uint64_t object_count;
  double psnr;               /* dB over black, mean over views, then over objects */
  double ssim;
  double training_psnr;      /* the same of a few objects that were learned from */
  /* Of detail, of which anchors are splats: dB of the coarse splats that they were made of, and of a cut of the
   * fitted object to as many splats as these are; 0: nothing was compared. */
  double coarse_psnr;
  double cut_psnr;
  uint64_t coarse_splats;
} StippleTrainBudget;

/* Trains a density autoencoder, or detail, on a collection of objects, as a job. In: config_path: a JSON file (docs/training.md);
 * resume: 1: goes on from the checkpoint in the folder of results, 0: begins, and is refused where one is left.
 * It writes weights.safetensors (of detail detail.safetensors), report.json and report.svg into that folder when it ends, of the state that was best
 * on some of the objects it learned from. A job that ends early, by a cancel or an error, leaves a checkpoint.
 * Errors of the start: IO; FORMAT for a file that is no JSON; INVALID_ARGUMENT for a key that is not known (with the
 * nearest one), a value out of range, a checkpoint that is left or missing, a file of another kind in the way;
 * MEMORY_LIMIT. Of the job: INVALID_ARGUMENT for a collection without an object that can be learned from, and for a
 * checkpoint of other settings or objects (says which); those of reading images and writing files.
 * Threads and determinism: the same bits for any number of threads, and wherever it was stopped and resumed. */
StippleStatus stipple_train_start(StippleContext* context, const char* config_path, uint32_t resume, StippleJob** job);
/* Never waits. In: figures->struct_size set. */
StippleStatus stipple_train_figures(const StippleJob* job, StippleTrainFigures* figures);
/* Gives one sentence on something that the user should know (an object that was left out). The text lives as long as
 * the job. */
StippleStatus stipple_train_note(const StippleJob* job, uint64_t index, const char** text);
StippleStatus stipple_train_budget(const StippleJob* job, uint64_t index, StippleTrainBudget* budget);

/* Makes a latent of an object by networks that were trained here, as a job (stipple_job_model): it decodes to splats
 * at any budget, where the object was. In: weights_path: a file of stipple_train_start; object_path: the folder of an
 * object as collections have them, of which the points are read, or a .ply of points with colours; token_count: of
 * the latent; 0: as many as were learned. Errors: IO, FORMAT; INVALID_ARGUMENT for weights of others, points without
 * colours or extent, tokens out of range; MEMORY_LIMIT.
 * Threads and determinism: the same result for any number of threads. docs/training.md. */
StippleStatus stipple_encode_start(StippleContext* context, const char* weights_path, const char* object_path,
                                   uint32_t token_count, StippleJob** job);

#ifdef __cplusplus
}
#endif
#endif /* STIPPLE_STIPPLE_H */
