// embed.h - SPIR-V compiled and validated at build time, by the name of its source file.
// Floor 1. Any thread, once all lists are added.
#ifndef HG_RENDERER_GPU_EMBED_H
#define HG_RENDERER_GPU_EMBED_H

#include <stddef.h>
#include <stdint.h>

struct hg_shader_binary {
    const char *name; // "tonemap.frag"
    const uint32_t *words;
    size_t size_bytes;
};

// Shaders that a program has beside the renderer's: those of tests.
struct hg_shader_list {
    const struct hg_shader_binary *items; // [count]
    size_t count;
    struct hg_shader_list *next; // set by hg_shader_add_list
};
// To be called while there is one thread. The list stays for good.
void hg_shader_add_list(struct hg_shader_list *list);

// NULL when there is no such shader. The renderer's come first.
const struct hg_shader_binary *hg_shader_find(const char *name);
// The renderer's, ordered by name.
const struct hg_shader_binary *hg_shader_table(size_t *count);

#endif
