#include "server/broker/session/annotation.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"

struct hg_annotation *hg_annotation_find(const struct hg_annotations *all, uint64_t number)
{
    for (uint32_t i = 0; i < all->count; i++)
        if (all->items[i].number == number)
            return &all->items[i];
    return NULL;
}

// Its place: those with larger numbers come behind it.
static struct hg_annotation *make_place(struct hg_annotations *all, uint32_t number)
{
    uint32_t at = all->count;
    if (hg_grow(&all->items, &all->capacity, (size_t)all->count + 1, sizeof *all->items))
        return NULL;
    while (at > 0 && all->items[at - 1].number > number)
        at--;
    memmove(&all->items[at + 1], &all->items[at], (all->count - at) * sizeof *all->items);
    all->items[at] = (struct hg_annotation){.number = number};
    all->count++;
    return &all->items[at];
}

struct hg_annotation *hg_annotation_put(
    struct hg_annotations *all, const struct hg_annotation *like, struct hgp_str text)
{
    char *copy = hg_strndup(text.size ? text.data : "", text.size);
    uint32_t number = like->number ? like->number : all->last_number + 1;
    struct hg_annotation *it = copy ? hg_annotation_find(all, number) : NULL;
    if (copy && !it)
        it = make_place(all, number);
    if (!it) {
        hg_free(copy);
        return NULL;
    }
    hg_free(it->text);
    *it = *like;
    it->number = number;
    it->text = copy;
    if (all->last_number < number)
        all->last_number = number;
    it->due = all->due = true;
    return it;
}

void hg_annotation_remove(struct hg_annotations *all, uint32_t number)
{
    struct hg_annotation *it = hg_annotation_find(all, number);
    if (!it)
        return;
    uint32_t at = (uint32_t)(it - all->items);
    hg_free(it->text);
    all->count--;
    memmove(it, it + 1, (all->count - at) * sizeof *it);
    all->due = true;
    if (all->gone_count < HG_ANNOTATIONS_GONE)
        all->gone[all->gone_count++] = number;
    else
        all->all_due = true;
}

void hg_annotations_finish(struct hg_annotations *all)
{
    for (uint32_t i = 0; i < all->count; i++)
        hg_free(all->items[i].text);
    hg_free(all->items);
    *all = (struct hg_annotations){0};
}

// ---- the state log ------------------------------------------------------------------------------

uint64_t hg_annotation_record(
    struct hg_state_log *log, uint32_t scene, const struct hg_annotation *it)
{
    struct hg_state_annotation record = {.scene = scene,
        .number = it->number,
        .kind = it->kind,
        .node = it->node,
        .color = it->color,
        .text = {it->text, (uint32_t)strlen(it->text)},
        .author = hgp_str_make(it->author),
        .label = hgp_str_make(it->label),
        .author_session = it->author_session,
        .time_ms = it->time_ms,
        .changed_ms = it->changed_ms};
    memcpy(record.position, it->position, sizeof record.position);
    memcpy(record.normal, it->normal, sizeof record.normal);
    memcpy(record.author_key, it->author_key, sizeof record.author_key);
    return hg_state_put_annotation(log, &record);
}

void hg_annotations_record_all(
    struct hg_state_log *log, uint32_t scene, const struct hg_annotations *all)
{
    for (uint32_t i = 0; i < all->count; i++)
        hg_annotation_record(log, scene, &all->items[i]);
    if (all->last_number && !hg_annotation_find(all, all->last_number))
        hg_state_put_annotation_end(log, scene, all->last_number);
}

enum hg_status hg_annotation_restore(
    struct hg_annotations *all, const struct hg_state_annotation *record)
{
    struct hg_annotation it = {.number = record->number,
        .kind = record->kind,
        .node = record->node,
        .color = record->color & 0xffffff,
        .author_session = record->author_session,
        .time_ms = record->time_ms,
        .changed_ms = record->changed_ms};
    memcpy(it.position, record->position, sizeof it.position);
    memcpy(it.normal, record->normal, sizeof it.normal);
    memcpy(it.author_key, record->author_key, sizeof it.author_key);
    snprintf(it.author, sizeof it.author, "%.*s", (int)record->author.size,
        record->author.size ? record->author.data : "");
    snprintf(it.label, sizeof it.label, "%.*s", (int)record->label.size,
        record->label.size ? record->label.data : "");
    return hg_annotation_put(all, &it, record->text) ? HG_OK : HG_E_NOMEM;
}
