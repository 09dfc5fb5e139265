// check.c - Vulkan results to status codes, and the hook that makes calls fail.
#include <stdatomic.h>

#include "base/log.h"
#include "renderer/gpu/internal.h"

static _Atomic uint64_t calls, fail_at;
static _Atomic int fail_result;

void hg_gpu_fail_at(uint64_t n, VkResult result)
{
    atomic_store(&calls, 0);
    atomic_store(&fail_result, result);
    atomic_store(&fail_at, n);
}

uint64_t hg_gpu_call_count(void)
{
    return atomic_load(&calls);
}

VkResult hg_gpu_injected(void)
{
    return atomic_load(&fail_result);
}

bool hg_gpu_call_fails(VkResult *result)
{
    *result = hg_gpu_injected();
    return atomic_fetch_add(&calls, 1) + 1 == atomic_load(&fail_at);
}

static const struct {
    VkResult result;
    enum hg_status status;
    const char *text;
} results[] = {
    {VK_ERROR_OUT_OF_HOST_MEMORY, HG_E_NOMEM, "out of host memory"},
    {VK_ERROR_OUT_OF_DEVICE_MEMORY, HG_E_NOMEM, "out of device memory"},
    {VK_ERROR_OUT_OF_POOL_MEMORY, HG_E_NOMEM, "out of pool memory"},
    {VK_ERROR_FRAGMENTED_POOL, HG_E_NOMEM, "fragmented pool"},
    {VK_ERROR_MEMORY_MAP_FAILED, HG_E_NOMEM, "memory could not be mapped"},
    {VK_ERROR_TOO_MANY_OBJECTS, HG_E_LIMIT, "too many objects"},
    {VK_ERROR_FORMAT_NOT_SUPPORTED, HG_E_LIMIT, "format not supported"},
    {VK_ERROR_DEVICE_LOST, HG_E_DEVICE_LOST, "device lost"},
    {VK_TIMEOUT, HG_E_DEVICE_LOST, "no progress within the time limit"},
    {VK_ERROR_INCOMPATIBLE_DRIVER, HG_E_DEVICE, "no Vulkan driver is installed"},
    {VK_ERROR_LAYER_NOT_PRESENT, HG_E_DEVICE, "a layer is not installed"},
    {VK_ERROR_EXTENSION_NOT_PRESENT, HG_E_DEVICE, "an extension is missing"},
    {VK_ERROR_FEATURE_NOT_PRESENT, HG_E_DEVICE, "a feature is missing"},
    {VK_ERROR_INITIALIZATION_FAILED, HG_E_DEVICE, "initialisation failed"},
};

enum hg_status hg_gpu_check(
    struct hg_gpu *gpu, VkResult result, const char *call, struct hg_error *err)
{
    if (result == VK_SUCCESS)
        return HG_OK;
    enum hg_status status = HG_E_DEVICE;
    const char *text = "failed";
    for (size_t i = 0; i < sizeof results / sizeof results[0]; i++) {
        if (results[i].result == result) {
            status = results[i].status;
            text = results[i].text;
        }
    }
    if (gpu != NULL && status == HG_E_DEVICE_LOST)
        gpu->lost = true;
    hg_fault(GPU, status, "%s: %s (VkResult %d)", call, text, (int)result);
    return hg_error_set(err, status, call, NULL, "%s (VkResult %d)", text, (int)result);
}
