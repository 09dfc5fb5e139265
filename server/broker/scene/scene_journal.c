#include "server/broker/scene/scene_journal.h"

#include <string.h>

#include "base/alloc.h"

// Entries of one object form a chain in log order; the first made the object.
struct entry {
    struct entry *prev, *next;   // the log
    struct entry *older, *newer; // the chain
    struct object *object;
    struct hg_packet *packet;
    uint64_t place; // increases along the log
};

struct object {
    struct object *next; // same bucket
    uint16_t type;
    uint64_t id;
    struct entry *first, *last;
};

struct hg_journal {
    struct hg_upload_store *store;
    struct entry *head, *tail;
    uint64_t next_place, entries, bytes;
    struct object **buckets;
    size_t bucket_count, object_count;
};

// Where an edit belongs: the object it makes or changes.
struct target {
    uint16_t type;
    uint64_t id;
};

enum { FIRST_BUCKETS = 64 };

// What an entry costs besides its payload, roughly.
enum { ENTRY_BYTES = sizeof(struct entry) + sizeof(struct object) + sizeof(struct hg_packet) + 64 };

// Fields that make sense only together: writing one of `any` overwrites all of `all`.
static const struct {
    uint16_t type;
    uint32_t any, all;
} coupled[] = {
    {HGP_T_environment_set, 0x6, 0x6}, // path or hash
    {HGP_T_material_set, 0x18, 0x18},  // emissive and its strength
    {HGP_T_light_set, 0x804, 0x804},   // intensity or lumens
};

bool hg_journal_wants(uint16_t type)
{
    switch (type) {
    case HGP_T_asset_load:
    case HGP_T_asset_unload:
    case HGP_T_mesh_set:
    case HGP_T_texture_set:
    case HGP_T_material_set:
    case HGP_T_node_set:
    case HGP_T_light_set:
    case HGP_T_camera_set:
    case HGP_T_environment_set:
    case HGP_T_animation_set:
    case HGP_T_variant_set:
    case HGP_T_object_remove:
        return true;
    default:
        return false;
    }
}

static bool has_bitmap(uint16_t type)
{
    switch (type) {
    case HGP_T_material_set:
    case HGP_T_node_set:
    case HGP_T_light_set:
    case HGP_T_camera_set:
    case HGP_T_environment_set:
        return true;
    default:
        return false;
    }
}

static uint32_t bits_of(const struct hg_packet *packet)
{
    struct hg_reader r = hg_reader_make(packet->payload, packet->header.length);
    return hg_read_u32(&r);
}

// ---- objects ------------------------------------------------------------------------------------

static size_t bucket_of(const struct hg_journal *j, struct target t)
{
    uint64_t h = (t.id ^ (uint64_t)t.type << 48) * 0x9e3779b97f4a7c15u;
    return (size_t)(h >> 32) & (j->bucket_count - 1);
}

static struct object *find(const struct hg_journal *j, struct target t)
{
    for (struct object *it = j->bucket_count ? j->buckets[bucket_of(j, t)] : NULL; it;
         it = it->next)
        if (it->type == t.type && it->id == t.id)
            return it;
    return NULL;
}

static enum hg_status grow_buckets(struct hg_journal *j)
{
    if (j->object_count < j->bucket_count)
        return HG_OK;
    size_t old_count = j->bucket_count, count = old_count ? old_count * 2 : FIRST_BUCKETS;
    struct object **old = j->buckets, **buckets = hg_calloc(count, sizeof *buckets);
    if (!buckets)
        return HG_E_NOMEM;
    j->buckets = buckets;
    j->bucket_count = count;
    for (size_t i = 0; i < old_count; i++)
        for (struct object *it = old[i], *next; it; it = next) {
            next = it->next;
            size_t b = bucket_of(j, (struct target){it->type, it->id});
            it->next = buckets[b];
            buckets[b] = it;
        }
    hg_free(old);
    return HG_OK;
}

static struct object *find_or_add(struct hg_journal *j, struct target t)
{
    struct object *object = find(j, t);
    if (object || grow_buckets(j))
        return object;
    object = hg_calloc(1, sizeof *object);
    if (!object)
        return NULL;
    object->type = t.type;
    object->id = t.id;
    size_t b = bucket_of(j, t);
    object->next = j->buckets[b];
    j->buckets[b] = object;
    j->object_count++;
    return object;
}

static void remove_object(struct hg_journal *j, struct object *object)
{
    struct object **link = &j->buckets[bucket_of(j, (struct target){object->type, object->id})];
    while (*link != object)
        link = &(*link)->next;
    *link = object->next;
    j->object_count--;
    hg_free(object);
}

// ---- uploads ------------------------------------------------------------------------------------

enum hg_status hg_journal_hold_uploads(
    struct hg_upload_store *store, const struct hg_packet *packet, bool hold)
{
    uint16_t type = packet->header.type;
    if (!store || (type != HGP_T_asset_load && type != HGP_T_environment_set))
        return HG_OK;
    struct hg_arena arena = {0};
    union hgp_any any;
    enum hg_status status = hgp_decode(HGP_VERSION_MAX, type,
        hg_reader_make(packet->payload, packet->header.length), &arena, &any, NULL);
    const struct hgp_asset_load *load = &any.asset_load;
    uint32_t count = status || type != HGP_T_asset_load ? 0 : load->files.count, done = 0;
    for (; done < count && !(hold && status); done++)
        if (hold)
            status = hg_upload_store_pin(store, load->files.items[done].hash);
        else
            hg_upload_store_unpin(store, load->files.items[done].hash);
    if (!status && type == HGP_T_environment_set && any.environment_set.has_hash) {
        if (hold)
            status = hg_upload_store_pin(store, any.environment_set.hash);
        else
            hg_upload_store_unpin(store, any.environment_set.hash);
    }
    for (uint32_t i = 0; status && hold && done && i + 1 < done; i++)
        hg_upload_store_unpin(store, load->files.items[i].hash);
    hg_arena_finish(&arena);
    return status;
}

// ---- the log ------------------------------------------------------------------------------------

static void unlink_entry(struct hg_journal *j, struct entry *e)
{
    *(e->prev ? &e->prev->next : &j->head) = e->next;
    *(e->next ? &e->next->prev : &j->tail) = e->prev;
    *(e->older ? &e->older->newer : &e->object->first) = e->newer;
    *(e->newer ? &e->newer->older : &e->object->last) = e->older;
}

static void remove_entry(struct hg_journal *j, struct entry *e)
{
    unlink_entry(j, e);
    j->entries--;
    j->bytes -= ENTRY_BYTES + e->packet->header.length;
    if (hg_journal_hold_uploads(j->store, e->packet, false)) {
        // The packet decoded when it was taken; only a lack of memory leads here, and then a pin
        // too many stays, which costs disk space and nothing else.
    }
    hg_packet_unref(e->packet);
    hg_free(e);
}

static void drop_object(struct hg_journal *j, struct object *object)
{
    while (object->first)
        remove_entry(j, object->first);
    remove_object(j, object);
}

static enum hg_status append(struct hg_journal *j, struct object *object, struct hg_packet *packet)
{
    struct entry *e = hg_calloc(1, sizeof *e);
    enum hg_status status = e ? hg_journal_hold_uploads(j->store, packet, true) : HG_E_NOMEM;
    if (status) {
        hg_free(e);
        return status;
    }
    *e = (struct entry){.prev = j->tail,
        .older = object->last,
        .object = object,
        .packet = hg_packet_ref(packet),
        .place = ++j->next_place};
    *(j->tail ? &j->tail->next : &j->head) = e;
    j->tail = e;
    *(object->last ? &object->last->newer : &object->first) = e;
    object->last = e;
    j->entries++;
    j->bytes += ENTRY_BYTES + packet->header.length;
    return HG_OK;
}

static void replace_packet(struct hg_journal *j, struct entry *e, struct hg_packet *packet)
{
    j->bytes += packet->header.length;
    j->bytes -= e->packet->header.length;
    hg_packet_unref(e->packet);
    e->packet = packet;
}

// ---- fields -------------------------------------------------------------------------------------

// A decoded message that can be changed and encoded again. STR fields borrow the packet.
struct edit {
    struct hg_arena arena;
    union hgp_any any;
};

static enum hg_status edit_open(const struct hg_packet *packet, struct edit *edit)
{
    *edit = (struct edit){0};
    return hgp_decode(HGP_VERSION_MAX, packet->header.type,
        hg_reader_make(packet->payload, packet->header.length), &edit->arena, &edit->any, NULL);
}

// Clears the optional fields whose bits are in `mask`; bits count the has_ members in order.
static void clear_fields(uint16_t type, union hgp_any *any, uint32_t mask)
{
    uint32_t bit = 1;
#define HGP_MESSAGE(name, id, direction, state, role, since, doc)                                  \
    if (type == HGP_T_##name) {                                                                    \
        struct hgp_##name *m = &any->name;                                                         \
        (void)m;
#define HGP_F(presence, kind, field, a, b, since, doc) CLEAR_##presence(field)
#define CLEAR_REQ(field)
#define CLEAR_OPT(field)                                                                           \
    if (mask & bit)                                                                                \
        m->has_##field = false;                                                                    \
    bit <<= 1;
#define HGP_MESSAGE_END(name) }
// Parts of lists have required fields only.
#define HGP_STRUCT(name, doc)
#define HGP_STRUCT_END(name)
#include "protocol/messages.def"
#undef CLEAR_REQ
#undef CLEAR_OPT
}

static struct hg_packet *encode(uint16_t type, const union hgp_any *any)
{
    return hg_packet_encode((enum hgp_type)type, any);
}

// Takes the fields in `mask` out of an older entry; removes it when nothing is left of a change.
static enum hg_status strip(struct hg_journal *j, struct entry *e, uint32_t mask)
{
    uint32_t bits = bits_of(e->packet);
    if (!(bits & mask))
        return HG_OK;
    if (!(bits & ~mask) && e != e->object->first) {
        remove_entry(j, e);
        return HG_OK;
    }
    struct edit edit;
    enum hg_status status = edit_open(e->packet, &edit);
    clear_fields(e->packet->header.type, &edit.any, mask);
    struct hg_packet *packet = status ? NULL : encode(e->packet->header.type, &edit.any);
    if (packet && hg_journal_hold_uploads(j->store, packet, true) == HG_OK) {
        if (hg_journal_hold_uploads(j->store, e->packet, false) == HG_OK)
            replace_packet(j, e, hg_packet_ref(packet));
    }
    hg_packet_unref(packet);
    hg_arena_finish(&edit.arena);
    return packet ? HG_OK : status ? status : HG_E_NOMEM;
}

static uint32_t overwritten_by(const struct hg_packet *packet)
{
    uint32_t bits = bits_of(packet);
    for (size_t i = 0; i < sizeof coupled / sizeof *coupled; i++)
        if (packet->header.type == coupled[i].type && (bits & coupled[i].any))
            bits |= coupled[i].all;
    return bits;
}

static enum hg_status accept_fields(
    struct hg_journal *j, struct object *object, struct hg_packet *packet)
{
    struct entry *last = object->last;
    enum hg_status status = append(j, object, packet);
    uint32_t mask = overwritten_by(packet);
    for (struct entry *e = last, *older; e && !status; e = older) {
        older = e->older;
        status = strip(j, e, mask);
    }
    return status;
}

// ---- references ---------------------------------------------------------------------------------

// Whether an object exists at a place of the log.
static bool exists_at(const struct hg_journal *j, uint16_t type, uint64_t id, uint64_t place)
{
    struct target t =
        id >> 32 ? (struct target){HGP_T_asset_load, id >> 32} : (struct target){type, id};
    const struct object *object = find(j, t);
    return !id || (object && object->first->place < place);
}

// True when all materials of a mesh exist at `place`; else *any gets copies without the missing.
static bool check_mesh(const struct hg_journal *j, struct edit *edit, uint64_t place, bool repair)
{
    struct hgp_mesh_set *m = &edit->any.mesh_set;
    bool all = true;
    for (uint32_t i = 0; i < m->parts.count; i++) {
        // The list was decoded into our own arena: it is ours to change.
        struct hgp_mesh_part *part = (struct hgp_mesh_part *)&m->parts.items[i];
        if (exists_at(j, HGP_T_material_set, part->material, place))
            continue;
        all = false;
        if (repair)
            part->material = 0;
    }
    return all;
}

// Makes what a removed object left behind: no reference. True when something was changed.
static bool drop_dead_references(
    const struct hg_journal *j, uint16_t type, struct edit *edit, uint64_t place)
{
    struct hgp_node_set *node = &edit->any.node_set;
    struct hgp_material_set *material = &edit->any.material_set;
    struct hgp_asset_load *load = &edit->any.asset_load;
    struct hgp_light_set *light = &edit->any.light_set;
    bool changed = false;
#define DROP(message, field, kind)                                                                 \
    if (message->has_##field && !exists_at(j, HGP_T_##kind, message->field, place)) {              \
        message->has_##field = false;                                                              \
        changed = true;                                                                            \
    }
    switch (type) {
    case HGP_T_node_set:
        DROP(node, parent, node_set)
        DROP(node, mesh, mesh_set)
        DROP(node, light, light_set)
        DROP(node, camera, camera_set)
        return changed;
    case HGP_T_material_set:
        DROP(material, base_color_texture, texture_set)
        DROP(material, metallic_roughness_texture, texture_set)
        DROP(material, normal_texture, texture_set)
        DROP(material, occlusion_texture, texture_set)
        DROP(material, emissive_texture, texture_set)
        return changed;
    case HGP_T_light_set:
        DROP(light, texture, texture_set)
        return changed;
    case HGP_T_asset_load:
        DROP(load, parent, node_set)
        return changed;
    case HGP_T_mesh_set:
        return !check_mesh(j, edit, place, true);
    default:
        return false;
    }
#undef DROP
}

// ---- accepting ----------------------------------------------------------------------------------

static enum hg_status accept_whole(
    struct hg_journal *j, struct object *object, struct hg_packet *packet, const struct edit *edit)
{
    struct entry *last = object->last;
    struct edit copy = *edit;
    if (last &&
        (packet->header.type != HGP_T_mesh_set || check_mesh(j, &copy, last->place, false))) {
        replace_packet(j, last, hg_packet_ref(packet));
        return HG_OK;
    }
    enum hg_status status = append(j, object, packet);
    // At most two entries: the one that made the mesh, and the newest.
    if (!status && last && last != object->first)
        remove_entry(j, last);
    return status;
}

// Later than all before it: poses and variants depend on their order among other edits.
static enum hg_status accept_last(
    struct hg_journal *j, struct object *object, struct hg_packet *packet)
{
    struct entry *last = object->last;
    enum hg_status status = append(j, object, packet);
    if (!status && last)
        remove_entry(j, last);
    return status;
}

// Poses of an asset are keyed by asset and animation.
static uint64_t pose_id(uint32_t asset, int32_t animation)
{
    return (uint64_t)asset << 32 | (uint32_t)animation;
}

// Drops every object for which `matches` holds.
static void drop_matching(
    struct hg_journal *j, bool (*matches)(const struct object *, uint64_t), uint64_t value)
{
    for (struct entry *e = j->head, *next; e; e = next) {
        next = e->next;
        if (!matches(e->object, value))
            continue;
        while (next && next->object == e->object)
            next = next->next;
        drop_object(j, e->object);
    }
}

static bool is_of_asset(const struct object *object, uint64_t asset)
{
    switch (object->type) {
    case HGP_T_asset_load:
    case HGP_T_variant_set:
        return object->id == asset;
    case HGP_T_environment_set:
        return false;
    default:
        return object->id >> 32 == asset;
    }
}

static bool is_pose_of(const struct object *object, uint64_t asset)
{
    return object->type == HGP_T_animation_set && object->id >> 32 == asset;
}

static void accept_removal(struct hg_journal *j, const struct hgp_object_remove *m)
{
    static const uint16_t types[] = {
        [HGP_object_kind_NODE] = HGP_T_node_set,
        [HGP_object_kind_MESH] = HGP_T_mesh_set,
        [HGP_object_kind_MATERIAL] = HGP_T_material_set,
        [HGP_object_kind_TEXTURE] = HGP_T_texture_set,
        [HGP_object_kind_LIGHT] = HGP_T_light_set,
        [HGP_object_kind_CAMERA] = HGP_T_camera_set,
    };
    struct object *object = find(j, (struct target){types[m->kind], m->object});
    if (object)
        drop_object(j, object);
}

static struct target target_of(uint16_t type, const union hgp_any *any)
{
    switch (type) {
    case HGP_T_asset_load:
        return (struct target){type, any->asset_load.asset};
    case HGP_T_mesh_set:
        return (struct target){type, any->mesh_set.mesh};
    case HGP_T_texture_set:
        return (struct target){type, any->texture_set.texture};
    case HGP_T_material_set:
        return (struct target){type, any->material_set.material};
    case HGP_T_node_set:
        return (struct target){type, any->node_set.node};
    case HGP_T_light_set:
        return (struct target){type, any->light_set.light};
    case HGP_T_camera_set:
        return (struct target){type, any->camera_set.camera};
    case HGP_T_animation_set:
        return (struct target){
            type, pose_id(any->animation_set.asset, any->animation_set.animation)};
    case HGP_T_variant_set:
        return (struct target){type, any->variant_set.asset};
    default: // environment_set: there is one
        return (struct target){type, 0};
    }
}

static enum hg_status accept_edit(
    struct hg_journal *j, struct hg_packet *packet, const struct edit *edit)
{
    uint16_t type = packet->header.type;
    if (type == HGP_T_animation_set && edit->any.animation_set.animation < 0)
        drop_matching(j, is_pose_of, edit->any.animation_set.asset); // all poses at once
    struct object *object = find_or_add(j, target_of(type, &edit->any));
    if (!object)
        return HG_E_NOMEM;
    enum hg_status status = has_bitmap(type) ? accept_fields(j, object, packet)
                            : type == HGP_T_mesh_set || type == HGP_T_texture_set
                                ? accept_whole(j, object, packet, edit)
                                : accept_last(j, object, packet);
    if (!object->first)
        remove_object(j, object);
    return status;
}

enum hg_status hg_journal_accept(struct hg_journal *j, struct hg_packet *packet)
{
    struct edit edit;
    enum hg_status status = edit_open(packet, &edit);
    if (status == HG_OK && packet->header.type == HGP_T_asset_unload)
        drop_matching(j, is_of_asset, edit.any.asset_unload.asset);
    else if (status == HG_OK && packet->header.type == HGP_T_object_remove)
        accept_removal(j, &edit.any.object_remove);
    else if (status == HG_OK)
        status = accept_edit(j, packet, &edit);
    hg_arena_finish(&edit.arena);
    return status;
}

// ---- playing ------------------------------------------------------------------------------------

static bool has_references(uint16_t type)
{
    return type == HGP_T_node_set || type == HGP_T_material_set || type == HGP_T_mesh_set ||
           type == HGP_T_asset_load;
}

// The entry as it is, or a copy without references to objects that are gone. NULL: no memory.
static struct hg_packet *clean_copy(const struct hg_journal *j, const struct entry *e)
{
    uint16_t type = e->packet->header.type;
    if (!has_references(type))
        return hg_packet_ref(e->packet);
    struct edit edit;
    struct hg_packet *packet = NULL;
    if (edit_open(e->packet, &edit) == HG_OK)
        packet = drop_dead_references(j, type, &edit, e->place) ? encode(type, &edit.any)
                                                                : hg_packet_ref(e->packet);
    hg_arena_finish(&edit.arena);
    return packet;
}

enum hg_status hg_journal_play(
    struct hg_journal *j, enum hg_status (*emit)(void *user, struct hg_packet *packet), void *user)
{
    for (struct entry *e = j->head; e; e = e->next) {
        struct hg_packet *packet = clean_copy(j, e);
        enum hg_status status = packet ? emit(user, packet) : HG_E_NOMEM;
        if (status)
            return status;
    }
    return HG_OK;
}

void hg_journal_each(
    const struct hg_journal *j, void (*take)(void *user, struct hg_packet *packet), void *user)
{
    for (const struct entry *e = j->head; e; e = e->next)
        take(user, e->packet);
}

static uint64_t own_id(const struct object *object)
{
    return object->id >> 32 ? object->id >> 32 : object->id;
}

void hg_journal_mark_ids(const struct hg_journal *j, uint32_t range, uint64_t *bits, uint32_t count)
{
    for (size_t i = 0; i < j->bucket_count; i++)
        for (const struct object *it = j->buckets[i]; it; it = it->next) {
            uint64_t n = (own_id(it) - 1) / range; // environment_set has id 0: beyond all
            if (n < count)
                bits[n / 64] |= UINT64_C(1) << n % 64;
        }
}

bool hg_journal_uses_ids(const struct hg_journal *j, uint32_t first, uint32_t count)
{
    for (size_t i = 0; i < j->bucket_count; i++)
        for (const struct object *it = j->buckets[i]; it; it = it->next) {
            uint64_t id = own_id(it);
            if (id >= first && id - first < count)
                return true;
        }
    return false;
}

struct hg_journal_stats hg_journal_get_stats(const struct hg_journal *j)
{
    return (struct hg_journal_stats){j->entries, j->bytes};
}

struct hg_journal *hg_journal_create(struct hg_upload_store *store)
{
    struct hg_journal *j = hg_calloc(1, sizeof *j);
    if (j)
        j->store = store;
    return j;
}

void hg_journal_destroy(struct hg_journal *j)
{
    if (!j)
        return;
    while (j->head)
        drop_object(j, j->head->object);
    hg_free(j->buckets);
    hg_free(j);
}
