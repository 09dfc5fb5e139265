#include "renderer/gpu/embed.h"

#include <string.h>

#include "renderer/gpu/embed_table.h"

static struct hg_shader_list own = {table, TABLE_COUNT, NULL};

void hg_shader_add_list(struct hg_shader_list *list)
{
    list->next = own.next;
    own.next = list;
}

const struct hg_shader_binary *hg_shader_find(const char *name)
{
    for (const struct hg_shader_list *list = &own; list != NULL; list = list->next)
        for (size_t i = 0; i < list->count; i++)
            if (strcmp(list->items[i].name, name) == 0)
                return &list->items[i];
    return NULL;
}

const struct hg_shader_binary *hg_shader_table(size_t *count)
{
    *count = own.count;
    return own.items;
}
