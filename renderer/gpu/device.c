// device.c - instance, choice of a device, features, validation.
#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/alloc.h"
#include "base/bytes.h"
#include "base/json.h"
#include "base/log.h"
#include "renderer/gpu/internal.h"

static const char validation_layer[] = "VK_LAYER_KHRONOS_validation";

// --- validation ----------------------------------------------------------------------------------

// A pass that keeps fewer outputs than its shader writes: what is left over is dropped, as is
// meant.
static bool is_harmless(const VkDebugUtilsMessengerCallbackDataEXT *data)
{
    return data->pMessageIdName && strstr(data->pMessageIdName, "ShaderOutputNotConsumed");
}

static VKAPI_ATTR VkBool32 VKAPI_CALL on_message(VkDebugUtilsMessageSeverityFlagBitsEXT severity,
    VkDebugUtilsMessageTypeFlagsEXT types, const VkDebugUtilsMessengerCallbackDataEXT *data,
    void *user)
{
    struct hg_gpu *gpu = user;
    (void)types;
    if (is_harmless(data))
        return VK_FALSE;
    __atomic_add_fetch(&gpu->debug.messages, 1, __ATOMIC_RELAXED);
    if ((severity & VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT) != 0)
        hg_fault(GPU, HG_E_INTERNAL, "validation: %s", data->pMessage);
    else
        hg_warn(GPU, "validation: %s", data->pMessage);
    return VK_FALSE;
}

uint32_t hg_gpu_validation_messages(const struct hg_gpu *gpu)
{
    return __atomic_load_n(&gpu->debug.messages, __ATOMIC_RELAXED);
}

static VkDebugUtilsMessengerCreateInfoEXT messenger_info(struct hg_gpu *gpu)
{
    return (VkDebugUtilsMessengerCreateInfoEXT){
        .sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT,
        .messageSeverity = VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT |
                           VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT,
        .messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT,
        .pfnUserCallback = on_message,
        .pUserData = gpu,
    };
}

static bool has_layer(const char *name)
{
    VkLayerProperties layers[64];
    uint32_t count = 64;
    if (vkEnumerateInstanceLayerProperties(&count, layers) < 0)
        return false;
    for (uint32_t i = 0; i < count; i++) {
        if (strcmp(layers[i].layerName, name) == 0)
            return true;
    }
    return false;
}

static bool has_instance_extension(const char *name)
{
    VkExtensionProperties extensions[128];
    uint32_t count = 128;
    if (vkEnumerateInstanceExtensionProperties(NULL, &count, extensions) < 0)
        return false;
    for (uint32_t i = 0; i < count; i++) {
        if (strcmp(extensions[i].extensionName, name) == 0)
            return true;
    }
    return false;
}

void hg_gpu_name(struct hg_gpu *gpu, VkObjectType type, uint64_t handle, const char *name)
{
    if (gpu->debug.set_name == NULL || name == NULL)
        return;
    const VkDebugUtilsObjectNameInfoEXT info = {
        .sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_OBJECT_NAME_INFO_EXT,
        .objectType = type,
        .objectHandle = handle,
        .pObjectName = name};
    if (gpu->debug.set_name(gpu->device, &info) != VK_SUCCESS)
        hg_debug(GPU, "%s: no debug name", name);
}

// --- instance ------------------------------------------------------------------------------------

// Mesa keeps compiled shaders itself; it reads its folder from the environment when the first
// device appears. A value given by the user wins.
static void point_mesa_cache(const struct hg_gpu *gpu)
{
    char path[4096];
    if (gpu->pipelines.cache_dir == NULL ||
        snprintf(path, sizeof path, "%s/shaders", gpu->pipelines.cache_dir) >= (int)sizeof path)
        return;
    if (mkdir(gpu->pipelines.cache_dir, 0700) != 0 && errno != EEXIST)
        hg_warn(GPU, "%s: %s", gpu->pipelines.cache_dir, strerror(errno));
    if (mkdir(path, 0700) != 0 && errno != EEXIST)
        hg_warn(GPU, "%s: %s", path, strerror(errno));
    if (setenv("MESA_SHADER_CACHE_DIR", path, 0) != 0)
        hg_warn(GPU, "the shader cache folder could not be set");
}

static enum hg_status wants_validation(
    const struct hg_gpu_params *params, bool *out, struct hg_error *err)
{
    const char *asked = getenv("HELIO_GPU_VALIDATION");
    const bool required = params->validation || (asked != NULL && strcmp(asked, "1") == 0);
    *out = false;
    if (!required && !params->validation_try)
        return HG_OK;
    if (has_layer(validation_layer)) {
        *out = true;
        return HG_OK;
    }
    if (required) {
        return hg_error_set(err, HG_E_DEVICE, "validation", NULL,
            "%s is not installed (Debian: vulkan-validationlayers)", validation_layer);
    }
    hg_warn(GPU, "validation is off: %s is not installed", validation_layer);
    return HG_OK;
}

static enum hg_status create_instance(
    struct hg_gpu *gpu, const struct hg_gpu_params *params, struct hg_error *err)
{
    enum hg_status status = wants_validation(params, &gpu->caps.validation, err);
    if (status != HG_OK)
        return status;
    gpu->debug.names = has_instance_extension(VK_EXT_DEBUG_UTILS_EXTENSION_NAME);
    const bool validation = gpu->caps.validation;
    const VkApplicationInfo app = {.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO,
        .pApplicationName = "heliograph",
        .apiVersion = VK_API_VERSION_1_3};
    const char *layers[] = {validation_layer};
    const char *extensions[2];
    uint32_t extension_count = 0;
    if (gpu->debug.names || validation)
        extensions[extension_count++] = VK_EXT_DEBUG_UTILS_EXTENSION_NAME;
    if (validation)
        extensions[extension_count++] = VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME;
    const VkValidationFeatureEnableEXT enables[] = {
        VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT};
    const VkDebugUtilsMessengerCreateInfoEXT messenger = messenger_info(gpu);
    const VkValidationFeaturesEXT features = {.sType = VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT,
        .pNext = &messenger,
        .enabledValidationFeatureCount = 1,
        .pEnabledValidationFeatures = enables};
    const VkInstanceCreateInfo info = {.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO,
        .pNext = validation ? &features : NULL,
        .pApplicationInfo = &app,
        .enabledLayerCount = validation ? 1 : 0,
        .ppEnabledLayerNames = layers,
        .enabledExtensionCount = extension_count,
        .ppEnabledExtensionNames = extensions};
    status = HG_VK(gpu, err, vkCreateInstance, &info, NULL, &gpu->instance);
    if (status != HG_OK || !validation)
        return status;
    const PFN_vkCreateDebugUtilsMessengerEXT create =
        (PFN_vkCreateDebugUtilsMessengerEXT)vkGetInstanceProcAddr(
            gpu->instance, "vkCreateDebugUtilsMessengerEXT");
    return create == NULL
               ? HG_OK
               : HG_VK(gpu, err, create, gpu->instance, &messenger, NULL, &gpu->debug.messenger);
}

// --- features ------------------------------------------------------------------------------------

struct features {
    VkPhysicalDeviceFeatures2 core;
    VkPhysicalDeviceVulkan11Features v11;
    VkPhysicalDeviceVulkan12Features v12;
    VkPhysicalDeviceVulkan13Features v13;
};

static void chain(struct features *f)
{
    *f = (struct features){.core = {VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, NULL, {0}}};
    f->v11.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_FEATURES;
    f->v12.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
    f->v13.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES;
    f->core.pNext = &f->v11;
    f->v11.pNext = &f->v12;
    f->v12.pNext = &f->v13;
}

// One row per feature: where it lives, whether the renderer can do without it.
#define FEATURES(X)                                                                                \
    X(v13.dynamicRendering, "dynamicRendering", true)                                              \
    X(v13.synchronization2, "synchronization2", true)                                              \
    X(v13.maintenance4, "maintenance4", true)                                                      \
    X(v12.bufferDeviceAddress, "bufferDeviceAddress", true)                                        \
    X(v12.timelineSemaphore, "timelineSemaphore", true)                                            \
    X(v12.scalarBlockLayout, "scalarBlockLayout", true)                                            \
    X(v11.shaderDrawParameters, "shaderDrawParameters", true)                                      \
    X(core.features.geometryShader, "geometryShader", true) /* gl_PrimitiveID in fragments */      \
    X(core.features.shaderInt64, "shaderInt64", true)       /* address arithmetic */               \
    X(core.features.imageCubeArray, "imageCubeArray", false)                                       \
    X(core.features.independentBlend, "independentBlend", true)                                    \
    X(core.features.fragmentStoresAndAtomics, "fragmentStoresAndAtomics", true) /* feedback */     \
    X(core.features.fullDrawIndexUint32, "fullDrawIndexUint32", true)                              \
    X(core.features.depthClamp, "depthClamp", false)                                               \
    X(core.features.samplerAnisotropy, "samplerAnisotropy", false)                                 \
    X(core.features.largePoints, "largePoints", false)

static const char *missing_feature(const struct features *have)
{
#define X(field, name, required)                                                                   \
    if (required && !have->field)                                                                  \
        return name;
    FEATURES(X)
#undef X
    return NULL;
}

static void enable_features(const struct features *have, struct features *want)
{
    chain(want);
#define X(field, name, required) want->field = have->field;
    FEATURES(X)
#undef X
}

static void query_features(VkPhysicalDevice device, struct features *out)
{
    chain(out);
    vkGetPhysicalDeviceFeatures2(device, &out->core);
}

static bool find_queue(VkPhysicalDevice device, uint32_t *family)
{
    VkQueueFamilyProperties families[32];
    uint32_t count = 32;
    vkGetPhysicalDeviceQueueFamilyProperties(device, &count, families);
    const VkQueueFlags need = VK_QUEUE_GRAPHICS_BIT | VK_QUEUE_COMPUTE_BIT;
    for (*family = 0; *family < count; ++*family) {
        if ((families[*family].queueFlags & need) == need)
            return true;
    }
    return false;
}

// --- choice --------------------------------------------------------------------------------------

static bool contains_ignoring_case(const char *text, const char *part)
{
    return strcasestr(text, part) != NULL;
}

static bool is_wanted(const char *wanted, uint32_t index, const char *name)
{
    if (wanted == NULL || wanted[0] == '\0')
        return true;
    char *end;
    const unsigned long number = strtoul(wanted, &end, 10);
    if (isdigit((unsigned char)wanted[0]) && *end == '\0')
        return number == index;
    return contains_ignoring_case(name, wanted);
}

static int rank(VkPhysicalDeviceType type)
{
    switch (type) {
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU:
        return 4;
    case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU:
        return 3;
    case VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU:
        return 2;
    case VK_PHYSICAL_DEVICE_TYPE_CPU:
        return 1;
    default:
        return 0;
    }
}

// Why a device cannot be used; NULL when it can.
static const char *refusal(VkPhysicalDevice device, const VkPhysicalDeviceProperties *props)
{
    struct features have;
    uint32_t family;
    if (props->apiVersion < VK_API_VERSION_1_3)
        return "no Vulkan 1.3";
    query_features(device, &have);
    if (missing_feature(&have) != NULL)
        return missing_feature(&have);
    return find_queue(device, &family) ? NULL : "no graphics and compute queue";
}

static void note(char *reasons, size_t size, uint32_t index, const char *name, const char *why)
{
    char line[128];
    snprintf(
        line, sizeof line, "%s%u %.60s: %.40s", reasons[0] != '\0' ? "; " : "", index, name, why);
    const size_t used = strlen(reasons), more = strlen(line);
    if (used + more < size)
        memcpy(reasons + used, line, more + 1);
}

static enum hg_status choose_device(struct hg_gpu *gpu, const char *wanted, struct hg_error *err)
{
    VkPhysicalDevice devices[32];
    uint32_t count = 32;
    char reasons[192] = "";
    int best = -1;
    enum hg_status status =
        HG_VK(gpu, err, vkEnumeratePhysicalDevices, gpu->instance, &count, devices);
    if (status != HG_OK)
        return status;
    for (uint32_t i = 0; i < count; i++) {
        VkPhysicalDeviceProperties props;
        vkGetPhysicalDeviceProperties(devices[i], &props);
        const char *why =
            is_wanted(wanted, i, props.deviceName) ? refusal(devices[i], &props) : "not asked for";
        if (why != NULL) {
            note(reasons, sizeof reasons, i, props.deviceName, why);
        } else if (rank(props.deviceType) > best) {
            best = rank(props.deviceType);
            gpu->physical.handle = devices[i];
        }
    }
    if (best >= 0)
        return HG_OK;
    return hg_error_set(err, HG_E_DEVICE, wanted != NULL ? wanted : "device", NULL,
        "no usable Vulkan 1.3 device%s%s", count > 0 ? ": " : " (none is installed)", reasons);
}

// --- ray queries ---------------------------------------------------------------------------------

static const char *const ray_extensions[] = {VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
    VK_KHR_RAY_QUERY_EXTENSION_NAME, VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME};
#define RAY_EXTENSIONS (sizeof ray_extensions / sizeof ray_extensions[0])

struct ray_features {
    VkPhysicalDeviceAccelerationStructureFeaturesKHR structure;
    VkPhysicalDeviceRayQueryFeaturesKHR query;
};

static void chain_rays(struct ray_features *f)
{
    *f = (struct ray_features){
        .structure = {.sType =
                          VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR,
            .pNext = &f->query},
        .query = {.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR}};
}

static bool has_ray_extensions(VkPhysicalDevice device)
{
    uint32_t count = 0, found = 0;
    if (vkEnumerateDeviceExtensionProperties(device, NULL, &count, NULL) < 0)
        return false;
    VkExtensionProperties *list = hg_calloc(count, sizeof *list);
    if (list == NULL || vkEnumerateDeviceExtensionProperties(device, NULL, &count, list) < 0)
        count = 0;
    for (uint32_t i = 0; i < count; i++)
        for (size_t k = 0; k < RAY_EXTENSIONS; k++)
            found += strcmp(list[i].extensionName, ray_extensions[k]) == 0;
    hg_free(list);
    return found == RAY_EXTENSIONS;
}

static bool has_ray_query(VkPhysicalDevice device)
{
    struct ray_features have;
    chain_rays(&have);
    if (!has_ray_extensions(device))
        return false;
    VkPhysicalDeviceFeatures2 features = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, .pNext = &have.structure};
    vkGetPhysicalDeviceFeatures2(device, &features);
    return have.structure.accelerationStructure && have.query.rayQuery;
}

static void want_rays(struct ray_features *want, struct features *others)
{
    chain_rays(want);
    want->structure.accelerationStructure = VK_TRUE;
    want->query.rayQuery = VK_TRUE;
    want->query.pNext = others->core.pNext;
    others->core.pNext = &want->structure;
}

// --- capabilities --------------------------------------------------------------------------------

static bool is_mapped(const VkPhysicalDeviceMemoryProperties *memory)
{
    const VkFlags all = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT | VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT |
                        VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    uint64_t largest = 0, mapped = 0;
    for (uint32_t i = 0; i < memory->memoryTypeCount; i++) {
        const uint64_t size = memory->memoryHeaps[memory->memoryTypes[i].heapIndex].size;
        const VkFlags flags = memory->memoryTypes[i].propertyFlags;
        if ((flags & VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT) != 0 && size > largest)
            largest = size;
        if ((flags & all) == all && size > mapped)
            mapped = size;
    }
    // A small window into device memory (256 MiB without resizable BAR) is no home for assets.
    return mapped > 0 && mapped >= largest / 2;
}

static void fill_limits(struct hg_gpu *gpu)
{
    VkPhysicalDeviceVulkan13Properties v13 = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_PROPERTIES};
    VkPhysicalDeviceVulkan12Properties v12 = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_PROPERTIES, .pNext = &v13};
    VkPhysicalDeviceVulkan11Properties v11 = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES, .pNext = &v12};
    VkPhysicalDeviceProperties2 props = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, .pNext = &v11};
    vkGetPhysicalDeviceProperties2(gpu->physical.handle, &props);
    struct hg_gpu_caps *caps = &gpu->caps;
    gpu->physical.properties = props.properties;
    gpu->physical.driver_id = v12.driverID;
    gpu->pipelines.driver_keeps_cache = v12.driverID == VK_DRIVER_ID_MESA_LLVMPIPE;
    snprintf(caps->device_name, sizeof caps->device_name, "%s", props.properties.deviceName);
    snprintf(caps->driver, sizeof caps->driver, "%.60s %.90s", v12.driverName, v12.driverInfo);
    caps->is_cpu = props.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU;
    caps->max_image_side_px = props.properties.limits.maxImageDimension2D;
    caps->max_image_layers = props.properties.limits.maxImageArrayLayers;
    caps->max_texels = props.properties.limits.maxTexelBufferElements;
    caps->max_allocation_bytes = v11.maxMemoryAllocationSize;
    caps->max_buffer_bytes = v13.maxBufferSize < v11.maxMemoryAllocationSize
                                 ? v13.maxBufferSize
                                 : v11.maxMemoryAllocationSize;
    caps->timestamp_period_ns = props.properties.limits.timestampComputeAndGraphics
                                    ? props.properties.limits.timestampPeriod
                                    : 0.0f;
}

static void fill_caps(struct hg_gpu *gpu, const struct hg_gpu_params *params)
{
    struct features have;
    fill_limits(gpu);
    query_features(gpu->physical.handle, &have);
    gpu->caps.depth_clamp = have.core.features.depthClamp;
    gpu->caps.anisotropy = have.core.features.samplerAnisotropy;
    gpu->caps.large_points = have.core.features.largePoints;
    gpu->caps.ray_query = has_ray_query(gpu->physical.handle);
    vkGetPhysicalDeviceMemoryProperties(gpu->physical.handle, &gpu->physical.memory_types);
    const char *force = getenv("HELIO_GPU_FORCE_STAGING");
    gpu->memory.force_staging = params->force_staging || (force != NULL && strcmp(force, "1") == 0);
    gpu->caps.mapped = is_mapped(&gpu->physical.memory_types) && !gpu->memory.force_staging;
    for (uint32_t i = 0; i < gpu->physical.memory_types.memoryHeapCount; i++) {
        const VkMemoryHeap *heap = &gpu->physical.memory_types.memoryHeaps[i];
        if ((heap->flags & VK_MEMORY_HEAP_DEVICE_LOCAL_BIT) != 0 &&
            heap->size > gpu->caps.memory_bytes)
            gpu->caps.memory_bytes = heap->size;
    }
}

// --- the device ----------------------------------------------------------------------------------

static enum hg_status create_device(struct hg_gpu *gpu, struct hg_error *err)
{
    struct features have, want;
    query_features(gpu->physical.handle, &have);
    enable_features(&have, &want);
    struct ray_features rays;
    if (gpu->caps.ray_query)
        want_rays(&rays, &want);
    if (!find_queue(gpu->physical.handle, &gpu->queue_family))
        return hg_error_set(err, HG_E_DEVICE, gpu->caps.device_name, NULL, "no queue");
    const float priority = 1.0f;
    const VkDeviceQueueCreateInfo queue = {.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
        .queueFamilyIndex = gpu->queue_family,
        .queueCount = 1,
        .pQueuePriorities = &priority};
    const VkDeviceCreateInfo info = {.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO,
        .pNext = &want.core,
        .queueCreateInfoCount = 1,
        .pQueueCreateInfos = &queue,
        .enabledExtensionCount = gpu->caps.ray_query ? RAY_EXTENSIONS : 0,
        .ppEnabledExtensionNames = ray_extensions};
    enum hg_status status =
        HG_VK(gpu, err, vkCreateDevice, gpu->physical.handle, &info, NULL, &gpu->device);
    if (status != HG_OK)
        return status;
    vkGetDeviceQueue(gpu->device, gpu->queue_family, 0, &gpu->queue);
    if (gpu->debug.names) {
        gpu->debug.set_name = (PFN_vkSetDebugUtilsObjectNameEXT)vkGetDeviceProcAddr(
            gpu->device, "vkSetDebugUtilsObjectNameEXT");
    }
    return HG_OK;
}

// --- all of it -----------------------------------------------------------------------------------

static enum hg_status copy_paths(
    struct hg_gpu *gpu, const struct hg_gpu_params *params, struct hg_error *err)
{
    if (params->cache_dir != NULL)
        gpu->pipelines.cache_dir = hg_strdup(params->cache_dir);
    if (params->shader_dir != NULL)
        gpu->shaders.dir = hg_strdup(params->shader_dir);
    if ((params->cache_dir != NULL && gpu->pipelines.cache_dir == NULL) ||
        (params->shader_dir != NULL && gpu->shaders.dir == NULL))
        return hg_error_set(err, HG_E_NOMEM, "device", NULL, "out of host memory");
    return HG_OK;
}

static enum hg_status init(
    struct hg_gpu *gpu, const struct hg_gpu_params *params, struct hg_error *err)
{
    enum hg_status status = copy_paths(gpu, params, err);
    if (status == HG_OK) {
        point_mesa_cache(gpu);
        status = create_instance(gpu, params, err);
    }
    if (status == HG_OK)
        status = choose_device(gpu, params->device, err);
    if (status != HG_OK)
        return status;
    fill_caps(gpu, params);
    gpu->strategy = hg_device_strategy_choose(gpu->caps.is_cpu, &params->overrides);
    status = create_device(gpu, err);
    if (status == HG_OK)
        status = hg_gpu_commands_init(gpu, err);
    if (status == HG_OK)
        status = hg_gpu_pipelines_init(gpu, err);
    if (status == HG_OK)
        hg_info(GPU, "%s, %s%s", gpu->caps.device_name, gpu->caps.driver,
            gpu->caps.validation ? ", validation on" : "");
    return status;
}

enum hg_status hg_gpu_create(
    const struct hg_gpu_params *params, struct hg_gpu **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_gpu *gpu = hg_calloc(1, sizeof *gpu);
    if (gpu == NULL)
        return hg_error_set(err, HG_E_NOMEM, "device", NULL, "out of host memory");
    gpu->images.epoch[0] = gpu->images.epoch[1] = 1; // 0 in image states: never touched
    enum hg_status status = init(gpu, params, err);
    if (status != HG_OK) {
        hg_gpu_destroy(gpu);
        return status;
    }
    *out = gpu;
    return HG_OK;
}

static void destroy_device(struct hg_gpu *gpu)
{
    if (gpu->queue != VK_NULL_HANDLE && vkDeviceWaitIdle(gpu->device) != VK_SUCCESS)
        hg_warn(GPU, "the device did not come to rest");
    gpu->batches.completed = gpu->batches.submitted;
    if (gpu->pipelines.cache != VK_NULL_HANDLE && !gpu->lost &&
        hg_gpu_save_pipeline_cache(gpu, NULL) != HG_OK)
        hg_warn(GPU, "the pipeline cache could not be written");
    hg_gpu_upload_finish(gpu);
    hg_gpu_pipelines_finish(gpu);
    hg_gpu_commands_finish(gpu);
    hg_gpu_memory_finish(gpu);
    hg_free(gpu->live.items);
    vkDestroyDevice(gpu->device, NULL);
}

void hg_gpu_destroy(struct hg_gpu *gpu)
{
    if (gpu == NULL)
        return;
    if (gpu->device != VK_NULL_HANDLE)
        destroy_device(gpu);
    if (gpu->debug.messenger != VK_NULL_HANDLE) {
        const PFN_vkDestroyDebugUtilsMessengerEXT destroy =
            (PFN_vkDestroyDebugUtilsMessengerEXT)vkGetInstanceProcAddr(
                gpu->instance, "vkDestroyDebugUtilsMessengerEXT");
        destroy(gpu->instance, gpu->debug.messenger, NULL);
    }
    if (gpu->instance != VK_NULL_HANDLE)
        vkDestroyInstance(gpu->instance, NULL);
    hg_free(gpu->pipelines.cache_dir);
    hg_free(gpu->shaders.dir);
    hg_free(gpu);
}

const struct hg_gpu_caps *hg_gpu_get_caps(const struct hg_gpu *gpu)
{
    return &gpu->caps;
}

const struct hg_device_strategy *hg_gpu_strategy(const struct hg_gpu *gpu)
{
    return &gpu->strategy;
}

VkDevice hg_gpu_device(const struct hg_gpu *gpu)
{
    return gpu->device;
}

// --- device JSON ---------------------------------------------------------------------------------

struct fallback {
    bool used;
    const char *name, *text;
};

static void write_features(struct hg_writer *w, const struct features *have)
{
    const char *comma = "";
    hg_json_put(w, ",\"features\":{");
#define X(field, name, required)                                                                   \
    hg_json_put(w, "%s\"" name "\":%s", comma, have->field ? "true" : "false");                    \
    comma = ",";
    FEATURES(X)
#undef X
    hg_json_put(w, "}");
}

static void write_fallbacks(struct hg_writer *w, const struct hg_gpu *gpu)
{
    const struct fallback list[] = {
        {!gpu->caps.mapped, "staging", "device memory is not mapped: uploads go through copies"},
        {!gpu->caps.depth_clamp, "depth_clamp", "shadow casters in front of a cascade are clipped"},
        {!gpu->caps.ray_query, "ray_query", "no ray queries: rays go through Embree or compute"},
        {!gpu->caps.large_points, "large_points", "points are drawn one pixel wide"},
        {gpu->caps.timestamp_period_ns <= 0, "timestamps", "passes are not timed on the device"},
        {gpu->caps.is_cpu, "cpu_device", "software rasteriser: textures stay RGBA8"},
        {gpu->pipelines.cache_dir == NULL, "no_shader_cache",
            "shaders are compiled again by each process"},
    };
    const char *comma = "";
    hg_json_put(w, ",\"fallbacks\":{");
    for (size_t i = 0; i < sizeof list / sizeof list[0]; i++) {
        if (!list[i].used)
            continue;
        hg_json_put(w, "%s\"%s\":\"%s\"", comma, list[i].name, list[i].text);
        comma = ",";
    }
    hg_json_put(w, "}");
}

static void write_limits(struct hg_writer *w, const struct hg_gpu_caps *caps)
{
    hg_json_put(w,
        ",\"type\":\"%s\",\"limits\":{\"image_side_px\":%u,\"image_layers\":%u,"
        "\"buffer_bytes\":%llu,\"allocation_bytes\":%llu,\"memory_bytes\":%llu},"
        "\"validation\":%s",
        caps->is_cpu ? "cpu" : "gpu", caps->max_image_side_px, caps->max_image_layers,
        (unsigned long long)caps->max_buffer_bytes, (unsigned long long)caps->max_allocation_bytes,
        (unsigned long long)caps->memory_bytes, caps->validation ? "true" : "false");
}

enum hg_status hg_gpu_device_json(const struct hg_gpu *gpu, char **text)
{
    struct hg_writer w = {0};
    struct features have;
    const uint32_t api = gpu->physical.properties.apiVersion;
    query_features(gpu->physical.handle, &have);
    hg_json_put(&w, "{\"name\":");
    hg_json_string(&w, gpu->caps.device_name);
    hg_json_put(&w, ",\"driver\":");
    hg_json_string(&w, gpu->caps.driver);
    hg_json_put(&w, ",\"api\":\"%u.%u.%u\"", VK_API_VERSION_MAJOR(api), VK_API_VERSION_MINOR(api),
        VK_API_VERSION_PATCH(api));
    write_limits(&w, &gpu->caps);
    write_features(&w, &have);
    write_fallbacks(&w, gpu);
    hg_json_put(&w, "}");
    return hg_json_take(&w, text);
}
