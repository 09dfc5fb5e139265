// embed.h - SPIR-V compiled and validated at build time, by the name of its source file.
// Floor 1. Read-only data; any thread.
#ifndef HG_RENDERER_GPU_EMBED_H
#define HG_RENDERER_GPU_EMBED_H

#include <stddef.h>
#include <stdint.h>

struct hg_shader_binary {
    const char *name; // "tonemap.frag"
    const uint32_t *words;
    size_t size_bytes;
};

// NULL when there is no such shader.
const struct hg_shader_binary *hg_shader_find(const char *name);
// All of them, ordered by name.
const struct hg_shader_binary *hg_shader_table(size_t *count);

#endif
