// shader.c - SPIR-V by the names of shaders, and modules of it for one pipeline each.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/gpu/embed.h"
#include "renderer/gpu/internal.h"
#include "renderer/gpu/optimise.h"
#include "renderer/gpu/specialise.h"

static enum hg_status compile(
    const struct hg_gpu *gpu, struct hg_gpu_shader *shader, struct hg_error *err)
{
    enum hg_status status =
        hg_gpu_compile(gpu->shaders.dir, shader->name, &shader->compiled, &shader->size_bytes, err);
    shader->words = shader->compiled;
    return status;
}

static enum hg_status find_embedded(struct hg_gpu_shader *shader, struct hg_error *err)
{
    const struct hg_shader_binary *binary = hg_shader_find(shader->name);
    if (binary == NULL)
        return hg_error_set(err, HG_E_NOTFOUND, shader->name, NULL, "no such shader");
    shader->words = binary->words;
    shader->size_bytes = binary->size_bytes;
    return HG_OK;
}

static const struct hg_gpu_shader *find(const struct hg_gpu *gpu, const char *name)
{
    for (uint32_t i = 0; i < gpu->shaders.count; i++)
        if (strcmp(gpu->shaders.items[i].name, name) == 0)
            return &gpu->shaders.items[i];
    return NULL;
}

enum hg_status hg_gpu_shader_ready(struct hg_gpu *gpu, const char *name, struct hg_error *err)
{
    if (find(gpu, name) != NULL)
        return HG_OK;
    if (hg_grow(&gpu->shaders.items, &gpu->shaders.capacity, gpu->shaders.count + 1,
            sizeof *gpu->shaders.items) != HG_OK)
        return hg_error_set(err, HG_E_NOMEM, name, NULL, "out of host memory");
    struct hg_gpu_shader *shader = &gpu->shaders.items[gpu->shaders.count];
    *shader = (struct hg_gpu_shader){0};
    snprintf(shader->name, sizeof shader->name, "%s", name);
    enum hg_status status =
        gpu->shaders.dir != NULL ? compile(gpu, shader, err) : find_embedded(shader, err);
    if (status == HG_OK)
        gpu->shaders.count++;
    return status;
}

enum hg_status hg_gpu_shader_module(struct hg_gpu *gpu, const char *name, const uint32_t *values,
    uint32_t value_count, struct hg_gpu_shader_module *out, struct hg_error *err)
{
    *out = (struct hg_gpu_shader_module){0};
    const struct hg_gpu_shader *shader = find(gpu, name);
    if (shader == NULL)
        return hg_error_set(err, HG_E_NOTFOUND, name, NULL, "no such shader");
    struct hg_spirv spirv, shorter;
    out->specialised =
        hg_spirv_specialise(shader->words, shader->size_bytes, values, value_count, &spirv);
    if (out->specialised && gpu->strategy.short_shaders &&
        hg_spirv_optimise(spirv.words, spirv.size_bytes, &shorter)) {
        hg_spirv_free(&spirv);
        spirv = shorter;
    }
    const VkShaderModuleCreateInfo info = {.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO,
        .codeSize = out->specialised ? spirv.size_bytes : shader->size_bytes,
        .pCode = out->specialised ? spirv.words : shader->words};
    enum hg_status status =
        HG_VK(gpu, err, vkCreateShaderModule, gpu->device, &info, NULL, &out->handle);
    hg_spirv_free(&spirv);
    if (status == HG_OK)
        hg_gpu_name(gpu, VK_OBJECT_TYPE_SHADER_MODULE, (uint64_t)out->handle, name);
    return status;
}

void hg_gpu_shaders_finish(struct hg_gpu *gpu)
{
    for (uint32_t i = 0; i < gpu->shaders.count; i++)
        hg_free(gpu->shaders.items[i].compiled);
    hg_free(gpu->shaders.items);
}
