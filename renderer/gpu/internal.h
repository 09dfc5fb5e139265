// internal.h - what the files of renderer/gpu/ share. Private to this room.
#ifndef HG_RENDERER_GPU_INTERNAL_H
#define HG_RENDERER_GPU_INTERNAL_H

#include "renderer/gpu/gpu.h"
#include "renderer/gpu/io.h"

#define HG_GPU_SLOTS         HG_GPU_MAX_IN_FLIGHT // batches, and as many uploads
#define HG_GPU_BLOCK_BYTES   (64ull << 20)        // one allocation from the driver
#define HG_GPU_STAGING_BYTES (32ull << 20)        // staging memory for copies
#define HG_GPU_WAIT_NS       120000000000ull      // no progress for this long = device lost
#define HG_GPU_SETS_PER_POOL 64

enum hg_gpu_memory_kind { HG_GPU_MEMORY_DEVICE, HG_GPU_MEMORY_UPLOAD, HG_GPU_MEMORY_READBACK };

struct hg_gpu_range {
    uint64_t offset, size_bytes;
};

struct hg_gpu_block {
    struct hg_gpu_block *next;
    VkDeviceMemory memory;
    uint64_t size_bytes;
    uint32_t type;
    void *mapped;                // NULL when the type is not host-visible
    struct hg_gpu_range *ranges; // free, ordered by offset, never adjacent
    size_t range_count, range_capacity;
    bool dedicated; // to one resource larger than half a block
};

struct hg_gpu_retired {
    uint64_t value;
    VkBuffer buffer;
    VkBufferView texels;
    VkImage image;
    VkImageView view, *layer_views, *mip_views;
    uint32_t layer_view_count, mip_view_count;
    struct hg_gpu_memory memory;
};

// What each mip of an image is used for (enum hg_gpu_use) after the commands recorded so far, by
// batches (0) and uploads (1); saved: before the open one of each, to go back to when it is thrown
// away.
struct hg_gpu_image_state {
    VkImage handle;
    uint8_t use[HG_GPU_MAX_MIPS], saved[2][HG_GPU_MAX_MIPS];
    uint64_t epoch[2];    // in which saved was written
    uint32_t prepared;    // mips whose barrier for the next use was put ahead (bits),
    uint64_t prepared_in; // while gpu->images.preparation is this
};

struct hg_gpu_cmd {
    struct hg_gpu *gpu;
    VkCommandPool pool;
    VkCommandBuffer handle;
    uint64_t value; // of its last submission
    VkDescriptorPool *set_pools;
    size_t set_pool_capacity;
    uint32_t set_pool_count, sets_used;
    VkQueryPool queries;
    const char *stages[HG_GPU_MAX_STAGES];
    uint32_t stage_count;
    bool stage_open;
};

// Copies in front of a batch, from staging memory of their own.
struct hg_gpu_upload {
    VkCommandPool pool;
    VkCommandBuffer handle;
    struct hg_gpu_buffer staging; // made when it is first used
    uint64_t value;               // of its last submission
};

#define HG_GPU_MAX_WRITTEN 64

struct hg_gpu_pipeline {
    struct hg_gpu_pipeline_params params;
    VkPipeline handle;
};

struct hg_gpu_shader {
    char name[64];
    const uint32_t *words;
    size_t size_bytes;
    uint32_t *compiled; // the words, where they are not embedded
};

struct hg_gpu_shader_module {
    VkShaderModule handle;
    bool specialised; // it holds the values of the constants
};

struct hg_gpu_live { // a buffer that has an address
    VkDeviceAddress address;
    uint64_t size_bytes;
    VkBuffer handle;
};

struct hg_gpu_io_layout {
    struct hg_gpu_io io;
    VkDescriptorSetLayout set;
    VkPipelineLayout pipeline;
};

struct hg_gpu_written {       // what a copy wrote
    uint64_t handle;          // of a buffer or image
    uint32_t plane;           // mip and layer of an image
    uint64_t low[2], high[2]; // bytes, or texels across and down
};

struct hg_gpu {
    struct hg_gpu_caps caps;
    struct hg_device_strategy strategy;
    VkInstance instance;
    VkDevice device;
    VkQueue queue;
    uint32_t queue_family;
    bool lost;

    struct {
        VkPhysicalDevice handle;
        VkPhysicalDeviceMemoryProperties memory_types;
        VkPhysicalDeviceProperties properties;
        uint32_t driver_version, driver_id;
        uint8_t pipeline_cache_uuid[VK_UUID_SIZE];
    } physical;

    struct {
        VkDebugUtilsMessengerEXT messenger;
        PFN_vkSetDebugUtilsObjectNameEXT set_name;
        uint32_t messages; // atomic
        bool names;
    } debug;

    struct {
        struct hg_gpu_block *blocks;
        struct hg_gpu_memory_stats stats;
        bool force_staging;
    } memory;

    struct {
        VkSemaphore timeline;
        uint64_t submitted, completed; // values of the timeline
        struct hg_gpu_cmd slots[HG_GPU_SLOTS];
        uint32_t next_slot;
        struct hg_gpu_cmd *open;
    } batches;

    struct {
        struct hg_gpu_retired *items;
        size_t capacity;
        uint32_t count;
    } retired; // freed when the batch that used them has completed

    struct {
        struct hg_gpu_stage_time items[HG_GPU_MAX_STAGES];
        uint32_t count;
    } times; // of the batch that was read last

    struct {
        struct hg_gpu_live *items; // by ascending address
        size_t capacity;
        uint32_t count;
    } live;

    struct {
        struct hg_gpu_image_state *states;
        size_t capacity;
        uint32_t count;
        uint64_t epoch[2]; // numbers of the open batch and the open upload
        uint64_t preparation;
    } images;

    struct {
        struct hg_gpu_upload slots[HG_GPU_SLOTS];
        struct hg_gpu_upload *open; // the one being recorded; NULL = none
        uint64_t staging_used;
        struct hg_gpu_written written[HG_GPU_MAX_WRITTEN]; // since its last barrier
        uint32_t written_count;
    } uploads;

    struct {
        VkDescriptorSetLayout layout;
        VkPipelineLayout pipeline_layout; // of pipelines with set 0 alone
        VkSampler samplers[HG_BIND_IMAGE_COUNT];
        struct hg_gpu_image dummies[HG_BIND_IMAGE_COUNT];
        struct hg_gpu_buffer dummy_frame;
        struct hg_gpu_buffer dummy_texels;
    } shared_set; // set 0, the same for every pipeline

    struct {
        struct hg_gpu_io_layout *layouts; // by content
        size_t capacity;
        uint32_t count;
        VkSampler samplers[2];                        // nearest, linear
        struct hg_gpu_image dummies[HG_GPU_IO_KINDS]; // made when something is not bound
    } io;                                             // set 1, declared by each pass

    struct {
        struct hg_gpu_pipeline *items;
        size_t capacity;
        uint32_t count;
        VkPipelineCache cache;
        size_t cache_bytes;   // when last saved
        uint32_t saved_count; // pipelines then
        char *cache_dir;
        bool driver_keeps_cache; // on disk, by itself
    } pipelines;

    struct {
        struct hg_gpu_shader *items;
        size_t capacity;
        uint32_t count;
        char *dir; // of GLSL to compile; NULL = the embedded words
    } shaders;
};

// True when the test hook wants this call to fail; *result is then what to return.
bool hg_gpu_call_fails(VkResult *result);
VkResult hg_gpu_injected(void);

// hg_gpu_check of one Vulkan call that the test hook can make fail.
#define HG_VK(gpu, err, fn, ...)                                                                   \
    hg_gpu_check(                                                                                  \
        gpu, hg_gpu_call_fails(&(VkResult){0}) ? hg_gpu_injected() : fn(__VA_ARGS__), #fn, err)

void hg_gpu_name(struct hg_gpu *gpu, VkObjectType type, uint64_t handle, const char *name);

// memory.c
enum hg_status hg_gpu_memory_take(struct hg_gpu *gpu, enum hg_gpu_memory_kind kind,
    const VkMemoryRequirements *need, struct hg_gpu_memory *out,
    struct hg_error *err) HG_MUST_CHECK;
void hg_gpu_memory_give(struct hg_gpu *gpu, struct hg_gpu_memory *memory);
void hg_gpu_memory_finish(struct hg_gpu *gpu);

// command.c
// Whether a wait of waited_ns, in which the process had used_ns of processor time, is for a device
// that is lost. A software rasteriser that is given no processor time is not: it has to have used
// half of HG_GPU_WAIT_NS, or to have been waited for ten times as long.
bool hg_gpu_is_stuck(bool is_cpu, uint64_t waited_ns, uint64_t used_ns);
enum hg_status hg_gpu_commands_init(struct hg_gpu *gpu, struct hg_error *err) HG_MUST_CHECK;
void hg_gpu_commands_finish(struct hg_gpu *gpu);
void hg_gpu_retire(struct hg_gpu *gpu, const struct hg_gpu_retired *object);
enum hg_status hg_gpu_submit_uploads(struct hg_gpu *gpu, struct hg_error *err) HG_MUST_CHECK;

// barrier.c; kind: 0 a batch, 1 an upload.
void hg_gpu_full_barrier(VkCommandBuffer cmd);
struct hg_gpu_mips {
    uint32_t first, count;
};
void hg_gpu_image_barrier(struct hg_gpu *gpu, int kind, struct hg_gpu_image *image,
    struct hg_gpu_mips mips, enum hg_gpu_use use);
VkImageLayout hg_gpu_layout(enum hg_gpu_use use);
void hg_gpu_restore_states(struct hg_gpu *gpu, int kind); // to those before the open one
bool hg_gpu_state_add(struct hg_gpu *gpu, VkImage image); // false: no memory
void hg_gpu_state_remove(struct hg_gpu *gpu, VkImage image);

// resource.c: the live buffer that holds an address, NULL when none does.
const struct hg_gpu_live *hg_gpu_find_live(const struct hg_gpu *gpu, VkDeviceAddress address);

// upload.c
void hg_gpu_upload_finish(struct hg_gpu *gpu);
uint32_t hg_gpu_texel_bytes(VkFormat format);

// descriptor.c
enum hg_status hg_gpu_descriptors_init(struct hg_gpu *gpu, struct hg_error *err) HG_MUST_CHECK;
void hg_gpu_descriptors_finish(struct hg_gpu *gpu);
enum hg_status hg_gpu_set_take(struct hg_gpu_cmd *cmd, VkDescriptorSetLayout layout,
    VkDescriptorSet *out, struct hg_error *err) HG_MUST_CHECK;

// io.c
enum hg_status hg_gpu_io_init(struct hg_gpu *gpu, struct hg_error *err) HG_MUST_CHECK;
void hg_gpu_io_finish(struct hg_gpu *gpu);
// Makes the layout when it is new; NULL: does nothing.
enum hg_status hg_gpu_io_ready(
    struct hg_gpu *gpu, const struct hg_gpu_io *io, struct hg_error *err) HG_MUST_CHECK;
// Of an io that is ready; NULL: that of set 0 alone. Any thread.
VkPipelineLayout hg_gpu_io_pipeline_layout(const struct hg_gpu *gpu, const struct hg_gpu_io *io);
bool hg_gpu_io_same(const struct hg_gpu_io *a, const struct hg_gpu_io *b);

// pipeline.c
enum hg_status hg_gpu_pipelines_init(struct hg_gpu *gpu, struct hg_error *err) HG_MUST_CHECK;
void hg_gpu_pipelines_finish(struct hg_gpu *gpu);

// shader.c: shaders are read once (hg_gpu_shader_ready, on one thread); modules of them are made
// for a pipeline and freed after it. HG_E_NOTFOUND, HG_E_FORMAT as hg_gpu_compile, HG_E_DEVICE.
enum hg_status hg_gpu_shader_ready(
    struct hg_gpu *gpu, const char *name, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_gpu_shader_module(struct hg_gpu *gpu, const char *name, const uint32_t *values,
    uint32_t value_count, struct hg_gpu_shader_module *out, struct hg_error *err) HG_MUST_CHECK;
void hg_gpu_shaders_finish(struct hg_gpu *gpu);

// compile.c: GLSL of a pass below `root` to SPIR-V words (freed with hg_free).
// HG_E_NOTFOUND, HG_E_FORMAT (err->what = file, err->where = "line N"), HG_E_NOMEM.
enum hg_status hg_gpu_compile(const char *root, const char *name, uint32_t **words,
    size_t *size_bytes, struct hg_error *err) HG_MUST_CHECK;

#endif
