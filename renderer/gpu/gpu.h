// gpu.h - the Vulkan device as the renderer sees it: memory, buffers, images, pipelines, commands.
// Floor 1. Thread: the render thread, unless said. Vulkan 1.3 is required; what else is optional
// stands in struct hg_gpu_caps with the fallback in use.
//
// Rules that keep it simple:
//  - Buffers are reached by device address, images by the one descriptor set of bindings.h.
//  - All work goes to one queue in order. hg_gpu_begin .. hg_gpu_submit records one batch; the
//    batch's timeline value says when it is over. Up to HG_GPU_MAX_IN_FLIGHT batches run before
//    hg_gpu_begin waits for the oldest. Code that needs a result waits for its value; host writes
//    to mapped memory must go where no batch in flight reads.
//  - Uploads that need a copy are recorded in front of the batch and are visible to all of it.
//  - Destroying is deferred: hg_gpu_*_destroy retires the object on the timeline, never waits.
//  - hg_gpu_image_use() is the only place where layouts and image barriers are made.
#ifndef HG_RENDERER_GPU_GPU_H
#define HG_RENDERER_GPU_GPU_H

#include <vulkan/vulkan.h>

#include "base/jobs.h"
#include "base/status.h"
#include "renderer/gpu/strategy.h"
#include "shaders/shared/bindings.h"

struct hg_gpu;
struct hg_gpu_cmd;
struct hg_gpu_block; // of device memory
struct hg_gpu_io;    // what a pass reads and writes (io.h)

struct hg_gpu_params {
    const char *device;     // part of a device name or an index; NULL = best (GPU before CPU)
    const char *cache_dir;  // NULL = none
    const char *shader_dir; // root of the GLSL tree, compiled at run time; NULL = embedded
    bool validation;        // HG_E_DEVICE when the layer is not installed;
                            // also the environment variable HELIO_GPU_VALIDATION=1
    bool validation_try;    // the same, but only a warning when it is not
    bool force_staging;     // never map device-local memory: the path of discrete GPUs, for tests;
                            // also the environment variable HELIO_GPU_FORCE_STAGING=1
    struct hg_device_overrides overrides;
};

struct hg_gpu_caps {
    char device_name[VK_MAX_PHYSICAL_DEVICE_NAME_SIZE], driver[160];
    bool is_cpu; // a software rasteriser; for what follows from that ask hg_gpu_strategy
    bool mapped; // device-local memory is host-visible: uploads are plain writes
    bool depth_clamp, anisotropy, large_points, validation;
    bool ray_query; // VK_KHR_ray_query, acceleration structures, buffers as input and storage
    uint32_t max_image_side_px, max_image_layers, max_texels;      // texels: of a buffer
    uint64_t max_buffer_bytes, max_allocation_bytes, memory_bytes; // memory: device-local heap
    float timestamp_period_ns;                                     // 0 = no timestamps
};

// HG_E_DEVICE with the reason for every device that was refused; HG_E_NOMEM.
enum hg_status hg_gpu_create(
    const struct hg_gpu_params *params, struct hg_gpu **out, struct hg_error *err) HG_MUST_CHECK;
void hg_gpu_destroy(struct hg_gpu *gpu); // waits for the queue; accepts NULL
const struct hg_gpu_caps *hg_gpu_get_caps(const struct hg_gpu *gpu);
const struct hg_device_strategy *hg_gpu_strategy(const struct hg_gpu *gpu);
VkDevice hg_gpu_device(const struct hg_gpu *gpu);
// Messages of the validation layers since creation.
uint32_t hg_gpu_validation_messages(const struct hg_gpu *gpu);
bool hg_gpu_is_lost(const struct hg_gpu *gpu); // a call has returned HG_E_DEVICE_LOST
// One JSON object (freed with hg_free): device, driver, limits, features, fallbacks in use.
enum hg_status hg_gpu_device_json(const struct hg_gpu *gpu, char **text) HG_MUST_CHECK;

// Bytes of device memory: in use by resources, taken from the driver, largest taken so far.
struct hg_gpu_memory_stats {
    uint64_t used_bytes, reserved_bytes, peak_bytes;
};
void hg_gpu_memory_stats(const struct hg_gpu *gpu, struct hg_gpu_memory_stats *out);

// Test hook: the n-th fallible Vulkan call from now (1 = next) fails with `result`; 0 disarms.
void hg_gpu_fail_at(uint64_t n, VkResult result);
uint64_t hg_gpu_call_count(void); // since the last hg_gpu_fail_at()
// Status of a Vulkan result; fills *err naming `call`. Marks the device as lost when it is.
enum hg_status hg_gpu_check(
    struct hg_gpu *gpu, VkResult result, const char *call, struct hg_error *err) HG_MUST_CHECK;

// --- memory, buffers -----------------------------------------------------------------------------

struct hg_gpu_memory {
    struct hg_gpu_block *block; // NULL = none
    uint64_t offset, size_bytes;
};

enum hg_gpu_buffer_kind {
    HG_GPU_BUFFER_DEVICE,   // read and written by shaders; mapped when caps.mapped
    HG_GPU_BUFFER_UPLOAD,   // always mapped, written by the host, read by the device
    HG_GPU_BUFFER_READBACK, // always mapped, written by the device, read by the host
    HG_GPU_BUFFER_TEXELS,   // as DEVICE, and can be bound to HG_BIND_TEXELS as texels of uvec4
};

// Zeroed = none. Every buffer can be storage, uniform, index, indirect, transfer source and target.
struct hg_gpu_buffer {
    VkBuffer handle;
    VkDeviceAddress address; // at least 256-byte aligned
    uint64_t size_bytes;
    void *mapped;        // NULL: not host-visible, use hg_gpu_buffer_upload
    VkBufferView texels; // HG_GPU_BUFFER_TEXELS
    struct hg_gpu_memory memory;
};

// Contents are undefined. HG_E_NOMEM (device memory), HG_E_LIMIT (larger than the device allows).
enum hg_status hg_gpu_buffer_create(struct hg_gpu *gpu, enum hg_gpu_buffer_kind kind,
    uint64_t size_bytes, const char *name, struct hg_gpu_buffer *out,
    struct hg_error *err) HG_MUST_CHECK;
// Retires and zeroes *buffer; accepts a zeroed one.
void hg_gpu_buffer_destroy(struct hg_gpu *gpu, struct hg_gpu_buffer *buffer);
// Makes *buffer at least size_bytes large (grows by half, contents are lost); keeps it otherwise.
// Another size tells that it is a new one: a new buffer may have the handle of the one before.
enum hg_status hg_gpu_buffer_reserve(struct hg_gpu *gpu, enum hg_gpu_buffer_kind kind,
    uint64_t size_bytes, const char *name, struct hg_gpu_buffer *buffer,
    struct hg_error *err) HG_MUST_CHECK;
// Writes bytes: at once when mapped, else by a copy in front of the next submitted batch.
enum hg_status hg_gpu_buffer_upload(struct hg_gpu *gpu, const struct hg_gpu_buffer *buffer,
    uint64_t offset, const void *data, uint64_t size_bytes, struct hg_error *err) HG_MUST_CHECK;

// --- images --------------------------------------------------------------------------------------

enum hg_gpu_image_kind {
    HG_GPU_IMAGE_2D,
    HG_GPU_IMAGE_2D_ARRAY,
    HG_GPU_IMAGE_CUBE,
    HG_GPU_IMAGE_3D
};

#define HG_GPU_MAX_MIPS 16

enum hg_gpu_use {    // what commands do with an image next
    HG_GPU_USE_NONE, // contents undefined
    HG_GPU_USE_SAMPLED,
    HG_GPU_USE_COLOR,      // colour attachment
    HG_GPU_USE_DEPTH,      // depth attachment
    HG_GPU_USE_COPY_READ,  // source of a transfer
    HG_GPU_USE_COPY_WRITE, // target of a transfer
    HG_GPU_USE_STORAGE,    // loads, stores and atomics of fragment and compute shaders
};

struct hg_gpu_image_params {
    enum hg_gpu_image_kind kind;
    VkFormat format;
    uint32_t width, height, layers, mips; // layers: 0 = 1 (cube: 6), mips: 0 = 1
    uint32_t depth;                       // of HG_GPU_IMAGE_3D; 0 = 1
    bool attachment;                      // rendered to (colour or depth, by format); not 3D
    bool storage;                         // loaded from and stored to by shaders
    bool aliased;                         // hg_gpu_image_alias may see it in another format
    // NULL: memory of its own. Else it lies there, at a multiple of its alignment; contents are
    // undefined when something else was written there since, which HG_GPU_USE_NONE says.
    const struct hg_gpu_memory *memory;
    uint64_t memory_offset;
    const char *name;
};

// Zeroed = none. All images can be sampled and be source and target of transfers.
struct hg_gpu_image {
    VkImage handle;
    VkImageView view; // of everything, of the kind's view type
    VkFormat format;
    VkImageAspectFlags aspect;
    uint32_t width, height, depth, layers, mips;
    enum hg_gpu_image_kind kind;
    struct hg_gpu_memory memory;
    // Attachments with layers or mips: 2D views, index mip * layers + layer.
    VkImageView *layer_views;
    // Storage images, and attachments with mips: all layers of one mip (of cubes as an array).
    VkImageView *mip_views;
    bool is_alias; // owns its view only
};

// HG_E_LIMIT (side, layers, mips, bytes or format not supported), HG_E_NOMEM.
enum hg_status hg_gpu_image_create(struct hg_gpu *gpu, const struct hg_gpu_image_params *params,
    struct hg_gpu_image *out, struct hg_error *err) HG_MUST_CHECK;
void hg_gpu_image_destroy(struct hg_gpu *gpu, struct hg_gpu_image *image); // as for buffers

// Memory that an image needs, for hg_gpu_image_params.memory.
struct hg_gpu_image_need {
    uint64_t size_bytes, alignment;
    uint32_t type_bits; // kinds of memory that it can lie in
};
void hg_gpu_image_need(
    struct hg_gpu *gpu, const struct hg_gpu_image_params *params, struct hg_gpu_image_need *out);
// Device memory for images that need no more than `need`. HG_E_NOMEM, HG_E_LIMIT.
enum hg_status hg_gpu_memory_create(struct hg_gpu *gpu, const struct hg_gpu_image_need *need,
    struct hg_gpu_memory *out, struct hg_error *err) HG_MUST_CHECK;
// Retires the memory; its images are destroyed before. Accepts a zeroed one.
void hg_gpu_memory_destroy(struct hg_gpu *gpu, struct hg_gpu_memory *memory);

// The same texels through another format of the same size and channels (UNORM and SRGB). Destroy it
// before its owner; only the owner may be uploaded to. HG_E_DEVICE, errors of _create.
enum hg_status hg_gpu_image_alias(struct hg_gpu *gpu, const struct hg_gpu_image *image,
    VkFormat format, const char *name, struct hg_gpu_image *out,
    struct hg_error *err) HG_MUST_CHECK;

struct hg_gpu_region {
    uint32_t mip, layer, x, y, width, height; // layer: of 3D images the slice
};
// Copies rows (row_bytes apart, 0 = tight) into the image in front of the next submitted batch and
// leaves it sampled. `data` may be freed at once.
enum hg_status hg_gpu_image_upload(struct hg_gpu *gpu, struct hg_gpu_image *image,
    const struct hg_gpu_region *region, const void *data, uint64_t row_bytes,
    struct hg_error *err) HG_MUST_CHECK;
// The same for layers [region->layer, +layers): data is layers x height rows.
enum hg_status hg_gpu_image_upload_layers(struct hg_gpu *gpu, struct hg_gpu_image *image,
    const struct hg_gpu_region *region, uint32_t layers, const void *data,
    struct hg_error *err) HG_MUST_CHECK;

// --- batches of commands -------------------------------------------------------------------------

#define HG_GPU_MAX_IN_FLIGHT 3

// Starts recording. One batch is open at a time; older ones may be in flight. HG_E_DEVICE_LOST.
enum hg_status hg_gpu_begin(
    struct hg_gpu *gpu, struct hg_gpu_cmd **out, struct hg_error *err) HG_MUST_CHECK;
// Submits what was recorded (and pending uploads); *value is its place on the timeline.
enum hg_status hg_gpu_submit(struct hg_gpu *gpu, struct hg_gpu_cmd *cmd, uint64_t *value,
    struct hg_error *err) HG_MUST_CHECK;
// Throws away what was recorded, after an error; images are as before the batch. The same happens
// when hg_gpu_submit fails.
void hg_gpu_discard(struct hg_gpu *gpu, struct hg_gpu_cmd *cmd);
// For work of the host in the middle of a batch. pause: submits what was recorded and waits for it;
// no batch is open then. resume: recording goes on, with the same cmd; nothing is bound, and times
// of stages are those since. An error leaves no batch open.
enum hg_status hg_gpu_pause(
    struct hg_gpu *gpu, struct hg_gpu_cmd *cmd, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_gpu_resume(
    struct hg_gpu *gpu, struct hg_gpu_cmd *cmd, struct hg_error *err) HG_MUST_CHECK;
// Waits until the timeline has reached value, then frees what was retired. Times out after 120 s of
// no progress with HG_E_DEVICE_LOST.
enum hg_status hg_gpu_wait(struct hg_gpu *gpu, uint64_t value, struct hg_error *err) HG_MUST_CHECK;
// Submits what was recorded and waits until it is over.
enum hg_status hg_gpu_submit_and_wait(
    struct hg_gpu *gpu, struct hg_gpu_cmd *cmd, struct hg_error *err) HG_MUST_CHECK;

VkCommandBuffer hg_gpu_cmd_handle(const struct hg_gpu_cmd *cmd); // of the open batch

// Layout and barrier for what comes next; same read use again is free. The image's contents are
// kept, except from HG_GPU_USE_NONE.
void hg_gpu_image_use(struct hg_gpu_cmd *cmd, struct hg_gpu_image *image, enum hg_gpu_use use);
// The same for some of its mips: one may be read while another is written.
void hg_gpu_image_use_mips(struct hg_gpu_cmd *cmd, struct hg_gpu_image *image, uint32_t first,
    uint32_t count, enum hg_gpu_use use);
// The same ahead of the command that binds or draws to it, which then puts no barrier of its own;
// until hg_gpu_cmd_end_prepared.
void hg_gpu_image_prepare(struct hg_gpu_cmd *cmd, struct hg_gpu_image *image, uint32_t first,
    uint32_t count, enum hg_gpu_use use);
void hg_gpu_cmd_end_prepared(struct hg_gpu_cmd *cmd);
// Makes buffer writes of all earlier commands visible to all later ones (and to the host).
void hg_gpu_memory_barrier(struct hg_gpu_cmd *cmd);
// Image or buffer to a host-readable buffer: rows tight, one mip and layer.
void hg_gpu_image_read(struct hg_gpu_cmd *cmd, struct hg_gpu_image *image,
    const struct hg_gpu_region *region, const struct hg_gpu_buffer *to, uint64_t offset);
// Buffer to one mip and layer of an image; rows of the buffer are row_px texels apart.
void hg_gpu_image_write(struct hg_gpu_cmd *cmd, struct hg_gpu_image *image,
    const struct hg_gpu_region *region, const struct hg_gpu_buffer *from, uint64_t offset,
    uint32_t row_px);

// A piece of a live buffer, by address (a multiple of 256). Zeroed = a dummy, which reads as zero.
struct hg_gpu_uniform {
    VkDeviceAddress address;
    uint64_t size_bytes; // <= HG_TABLE_BYTES
};
struct hg_gpu_bindings {
    // The images are brought to HG_GPU_USE_SAMPLED by hg_gpu_cmd_bind; NULL = a 1x1 dummy.
    struct hg_gpu_image *images[HG_BIND_IMAGE_COUNT];
    struct hg_gpu_uniform uniforms[HG_BIND_UNIFORM_COUNT]; // of binding HG_BIND_UNIFORM_FIRST + i
    const struct hg_gpu_buffer *texels;                    // NULL = a dummy
};
// True when a table can be bound as a uniform block: size, alignment, and it lies in a live buffer.
bool hg_gpu_can_bind_uniform(const struct hg_gpu *gpu, const struct hg_gpu_uniform *uniform);
// Binds the set for graphics and compute. Call outside rendering.
enum hg_status hg_gpu_cmd_bind(struct hg_gpu_cmd *cmd, const struct hg_gpu_bindings *bindings,
    struct hg_error *err) HG_MUST_CHECK;
void hg_gpu_cmd_push(struct hg_gpu_cmd *cmd, const void *data, uint32_t size_bytes); // <= 128

#define HG_GPU_MAX_COLORS 4

struct hg_gpu_target {
    struct hg_gpu_image *image; // brought to its attachment use
    uint32_t layer, mip;        // of arrays and cubes
    bool clear, discard;        // else keep; discard: contents before do not matter
    VkClearValue value;
};
struct hg_gpu_rendering {
    struct hg_gpu_target colors[HG_GPU_MAX_COLORS];
    uint32_t color_count;
    struct hg_gpu_target depth; // image NULL = none
    VkRect2D area;              // zero = all of it; also sets viewport and scissor
};
// Sets viewport (y down, depth 0..1), scissor, no culling, counter-clockwise front faces.
void hg_gpu_cmd_begin_rendering(struct hg_gpu_cmd *cmd, const struct hg_gpu_rendering *rendering);
void hg_gpu_cmd_end_rendering(struct hg_gpu_cmd *cmd);

// Times the commands between the two; nesting is not allowed. `name` must outlive the batch.
void hg_gpu_cmd_begin_stage(struct hg_gpu_cmd *cmd, const char *name);
void hg_gpu_cmd_end_stage(struct hg_gpu_cmd *cmd);

#define HG_GPU_MAX_STAGES 48

struct hg_gpu_stage_time {
    const char *name;
    uint64_t ns;
};
// Stages of the newest batch that was waited for, in order; equal names are added up.
uint32_t hg_gpu_stage_times(
    const struct hg_gpu *gpu, struct hg_gpu_stage_time out[HG_GPU_MAX_STAGES]);

// --- pipelines -----------------------------------------------------------------------------------

#define HG_GPU_MAX_SPEC 8

enum hg_gpu_blend {
    HG_GPU_BLEND_NONE,
    HG_GPU_BLEND_ADD,           // dst + src
    HG_GPU_BLEND_PREMULTIPLIED, // src + (1 - src.a) dst
};

// Cached by content: fill it again each time. Zero-initialise (padding counts); names are string
// literals such as "visibility.vert" (file in shaders/passes/).
#define HG_GPU_MAX_MAKING                                                                          \
    8 // at once by hg_gpu_pipelines_make; more are made when they are asked for

struct hg_gpu_pipeline_params {
    const char *compute;            // compute pipeline, or
    const char *vertex, *fragment;  // graphics; fragment NULL = depth only
    uint32_t spec[HG_GPU_MAX_SPEC]; // specialisation constants 0..spec_count-1 (bit patterns)
    uint32_t spec_count;
    VkFormat colors[HG_GPU_MAX_COLORS];
    uint32_t color_count;
    VkFormat depth;            // VK_FORMAT_UNDEFINED = none
    VkCompareOp depth_compare; // VK_COMPARE_OP_NEVER (0) = no depth test
    bool depth_write;
    bool depth_bias;  // vkCmdSetDepthBias before drawing
    bool depth_clamp; // ignored where caps.depth_clamp is false
    bool positions;   // vertex buffer 0 holds vec3s, 12 bytes apart, for location 0
    bool with_words;  // each followed by a word for location 1: 16 bytes apart
    VkPrimitiveTopology topology;
    enum hg_gpu_blend blend;    // of colour 0; others are never blended
    const struct hg_gpu_io *io; // descriptor set 1, kept by the cache; NULL: none
};

// Creates on first use. Dynamic state: viewport, scissor, cull mode, front face, depth bias.
// HG_E_NOTFOUND (shader name), HG_E_FORMAT (GLSL of --shader-dir: file and line), HG_E_DEVICE.
enum hg_status hg_gpu_pipeline_get(struct hg_gpu *gpu, const struct hg_gpu_pipeline_params *params,
    VkPipeline *out, struct hg_error *err) HG_MUST_CHECK;
// Creates those of `count` that are not there yet, side by side: large shaders take the driver a
// tenth of a second and more. Then hg_gpu_pipeline_get finds them.
enum hg_status hg_gpu_pipelines_make(struct hg_gpu *gpu,
    const struct hg_gpu_pipeline_params *params, uint32_t count, struct hg_jobs *jobs,
    struct hg_error *err) HG_MUST_CHECK;
// The same as hg_gpu_pipeline_get and binds it.
enum hg_status hg_gpu_cmd_pipeline(struct hg_gpu_cmd *cmd,
    const struct hg_gpu_pipeline_params *params, struct hg_error *err) HG_MUST_CHECK;
// Number of pipelines made so far.
uint32_t hg_gpu_pipeline_count(const struct hg_gpu *gpu);
// Writes the driver's pipeline cache to cache_dir when pipelines were made since the last call
// (no-op on drivers with their own).
enum hg_status hg_gpu_save_pipeline_cache(struct hg_gpu *gpu, struct hg_error *err) HG_MUST_CHECK;

#endif
