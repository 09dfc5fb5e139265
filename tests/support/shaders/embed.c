// embed.c - adds the shaders of this folder to those of the renderer.
#include "renderer/gpu/embed_table.h"

static struct hg_shader_list list = {table, TABLE_COUNT, NULL};

__attribute__((constructor)) static void add_shaders(void)
{
    hg_shader_add_list(&list);
}
