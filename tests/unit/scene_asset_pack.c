// scene_asset_pack.c - assets as bytes: what goes in comes out, and what anybody made is checked.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/asset_pack.h"

enum { NUMBER = 7 };

static void *floats(const float *from, size_t count)
{
    float *to = hg_calloc(count, sizeof *to);
    assert_non_null(to);
    memcpy(to, from, count * sizeof *to);
    return to;
}

static void make_mesh(struct hg_asset *a)
{
    static const float corners[] = {0, 0, 0, 1, 0, 0, 0, 1, 0}, up[] = {0, 0, 1, 0, 0, 1, 0, 0, 1};
    static const float ones[] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    struct hg_mesh *mesh = hg_asset_add_mesh(a, "triangle");
    struct hg_mesh_part *part = mesh->parts = hg_calloc(1, sizeof *part);
    mesh->part_count = 1;
    part->vertex_count = part->index_count = 3;
    part->positions = floats(corners, 9);
    part->normals = floats(up, 9);
    part->uv[0] = floats(corners, 6);
    part->colors = floats(ones, 12);
    part->weights = floats(ones, 12);
    part->joints = hg_calloc(12, sizeof *part->joints);
    part->joints[4] = 1;
    part->joint_sets = 1;
    part->indices = hg_calloc(3, sizeof *part->indices);
    part->indices[1] = 1;
    part->indices[2] = 2;
    part->material = a->materials[0];
    part->targets = hg_calloc(2, sizeof *part->targets); // of which one moves nothing
    part->targets[1].positions = floats(up, 9);
    part->targets[1].normals = floats(corners, 9);
    mesh->weights = floats(corners + 2, 2);
    mesh->target_count = 2;
    hg_mesh_part_update_bounds(part, 2);
}

static void make_nodes(struct hg_asset *a)
{
    struct hg_node *root = hg_asset_add_node(a, "root"), *arm = hg_asset_add_node(a, "arm");
    struct hg_node *hand = hg_asset_add_node(a, "hand");
    struct hg_skin *skin = hg_asset_add_skin(a);
    hg_node_append_child(root, arm);
    hg_node_append_child(root, hand);
    root->has_matrix = true;
    root->matrix[12] = 3;
    arm->translation[1] = 2;
    arm->mesh = a->meshes[0];
    arm->skin = skin;
    arm->weights = floats(a->meshes[0]->weights, 2);
    hand->light = a->lights[0];
    hand->camera = a->cameras[0];
    hand->visible = false;
    skin->joint_count = 2;
    skin->joints = hg_calloc(2, sizeof *skin->joints);
    skin->joints[0] = arm;
    skin->joints[1] = hand;
    skin->inverse_bind = hg_calloc(2, sizeof *skin->inverse_bind);
    skin->inverse_bind[1][5] = 1;
    a->roots = hg_calloc(1, sizeof *a->roots);
    a->roots[a->root_count++] = root;
}

static void make_animation(struct hg_asset *a)
{
    static const float times[] = {0, 1}, turns[] = {0, 0, 0, 1, 0, 1, 0, 0};
    static const float shapes[] = {0, 1, 1, 0.5f};
    struct hg_animation *animation = a->animations = hg_calloc(1, sizeof *animation);
    a->animation_count = 1;
    animation->name = hg_strdup("wave");
    animation->duration_s = 1;
    animation->channel_count = 2;
    animation->channels = hg_calloc(2, sizeof *animation->channels);
    *animation->channels = (struct hg_anim_channel){.node = a->nodes[1],
        .path = HG_ANIM_ROTATION,
        .interpolation = HG_ANIM_LINEAR,
        .key_count = 2,
        .width = 4,
        .times = floats(times, 2),
        .values = floats(turns, 8)};
    animation->channels[1] = (struct hg_anim_channel){.node = a->nodes[1],
        .path = HG_ANIM_WEIGHTS,
        .interpolation = HG_ANIM_LINEAR,
        .key_count = 2,
        .width = 2,
        .times = floats(times, 2),
        .values = floats(shapes, 4)};
}

static struct hg_asset *make_asset(void)
{
    struct hg_asset *a = hg_asset_create(NUMBER, "made.dae");
    strcpy(a->file.format, "collada");
    struct hg_texture *named = hg_asset_add_texture(a, "stone"),
                      *plain = hg_asset_add_texture(a, "");
    named->image = hg_image_source_create("stone\xe9.png"); // as in the file, whatever it is
    named->wrap_s = HG_WRAP_MIRROR;
    plain->image = hg_image_source_create("*0");
    assert_int_equal(hg_image_create(2, 1, HG_PIXEL_RGBA8, NULL, &plain->image->pixels), HG_OK);
    memset(plain->image->pixels.pixels, 5, 8);
    plain->image->pixels_srgb = true;
    struct hg_texture *whole = hg_asset_add_texture(a, "whole");
    whole->image = hg_image_source_create("*1");
    whole->image->encoded = hg_refbuf_create(3);
    struct hg_material *m = hg_asset_add_material(a, "red");
    m->base_color[1] = 0.25f;
    m->alpha_mode = HG_ALPHA_BLEND;
    m->slots[HG_SLOT_NORMAL].texture = plain;
    m->slots[HG_SLOT_NORMAL].uv_set = 1;
    struct hg_light *light = hg_asset_add_light(a, "lamp");
    light->kind = HG_LIGHT_SPOT;
    light->intensity = 40;
    hg_asset_add_camera(a, "eye")->near = 0.5f;
    make_mesh(a);
    make_nodes(a);
    make_animation(a);
    hg_asset_warn(a, "somewhere", "something");
    return a;
}

static struct hg_writer pack(struct hg_asset *asset)
{
    struct hg_writer w = {0};
    hg_asset_pack(asset, &w);
    assert_false(w.failed);
    return w;
}

static enum hg_status unpack(
    const uint8_t *data, size_t size, uint64_t limit, struct hg_asset **out, struct hg_error *err)
{
    uint8_t *exact = hg_calloc(size, 1); // so that sanitizers see the end
    memcpy(exact, data, size);
    const struct hg_asset_unpack params = {.data = exact,
        .size = size,
        .asset_number = NUMBER,
        .memory_limit_bytes = limit,
        .label = "made.dae"};
    const enum hg_status status = hg_asset_unpack(&params, out, err);
    hg_free(exact);
    return status;
}

static void test_what_goes_in_comes_out(void **state)
{
    (void)state;
    struct hg_asset *made = make_asset(), *read;
    struct hg_error err = {0};
    struct hg_writer first = pack(made);
    if (unpack(first.data, first.size, 1 << 20, &read, &err))
        fail_msg("%s: %s", err.where, err.reason);
    struct hg_writer second = pack(read);
    assert_int_equal(first.size, second.size);
    assert_memory_equal(first.data, second.data, first.size);
    assert_int_equal(read->nodes[2]->head.id, (uint64_t)NUMBER << 32 | 2);
    assert_ptr_equal(read->nodes[0]->first_child->next_sibling, read->nodes[2]);
    assert_ptr_equal(read->nodes[1]->skin->joints[1], read->nodes[2]);
    assert_false(read->nodes[2]->visible);
    assert_float_equal(read->lights[0]->intensity, 40, 0);
    assert_float_equal(read->meshes[0]->parts->bounds_max[1], 1, 0);
    assert_float_equal(read->meshes[0]->parts->bounds_max[2], 1, 0); // of the target
    assert_float_equal(read->nodes[1]->weights[1], 1, 0);
    assert_string_equal(read->textures[0]->image->label, "stone\xe9.png");
    assert_null(read->textures[0]->image->encoded);
    assert_int_equal(read->textures[2]->image->encoded->size, 3);
    assert_int_equal(read->warning_count, 1);
    assert_string_equal(read->warnings[0].reason, "something");
    hg_writer_finish(&first);
    hg_writer_finish(&second);
    hg_asset_destroy(made);
    hg_asset_destroy(read);
}

static void test_every_prefix_is_refused(void **state)
{
    (void)state;
    struct hg_asset *made = make_asset(), *read;
    struct hg_writer w = pack(made);
    for (size_t size = 0; size < w.size; size++) {
        struct hg_error err = {0};
        assert_int_equal(unpack(w.data, size, 1 << 20, &read, &err), HG_E_FORMAT);
        assert_null(read);
        assert_true(err.where[0] && err.reason[0]);
    }
    hg_writer_finish(&w);
    hg_asset_destroy(made);
}

// Whatever word is replaced: a sound asset or none.
static void test_numbers_at_their_limits(void **state)
{
    (void)state;
    static const uint32_t values[] = {
        0, 1, 3, 0x7fffffff, 0x80000000, 0xffffffff, 0x7f800000, 0x7fc00000};
    struct hg_asset *made = make_asset(), *read;
    struct hg_writer w = pack(made);
    unsigned refused = 0;
    for (size_t at = 0; at + 4 <= w.size; at++)
        for (size_t i = 0; i < sizeof values / sizeof *values; i++) {
            uint8_t kept[4];
            memcpy(kept, w.data + at, 4);
            memcpy(w.data + at, &values[i], 4);
            struct hg_error err = {0};
            refused += unpack(w.data, w.size, 1 << 20, &read, &err) != HG_OK;
            hg_asset_destroy(read);
            memcpy(w.data + at, kept, 4);
        }
    assert_true(refused > w.size); // of 8 a byte
    hg_writer_finish(&w);
    hg_asset_destroy(made);
}

static void test_memory_has_a_limit(void **state)
{
    (void)state;
    struct hg_asset *made = make_asset(), *read;
    struct hg_writer w = pack(made);
    struct hg_error err = {0};
    assert_int_equal(unpack(w.data, w.size, 600, &read, &err), HG_E_LIMIT);
    assert_null(read);
    hg_writer_finish(&w);
    hg_asset_destroy(made);
}

static void test_no_memory(void **state)
{
    (void)state;
    struct hg_asset *made = make_asset(), *read = NULL;
    struct hg_writer w = pack(made);
    enum hg_status status = HG_E_NOMEM;
    for (uint64_t n = 2; status; n++) { // the first is the test's own copy
        struct hg_error err = {0};
        hg_alloc_fail_at(n);
        status = unpack(w.data, w.size, 1 << 20, &read, &err);
        assert_true(status == HG_OK || status == HG_E_NOMEM);
        assert_true((read != NULL) == (status == HG_OK));
    }
    hg_alloc_fail_at(0);
    hg_asset_destroy(read);
    hg_writer_finish(&w);
    hg_asset_destroy(made);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_what_goes_in_comes_out),
        cmocka_unit_test(test_every_prefix_is_refused),
        cmocka_unit_test(test_numbers_at_their_limits),
        cmocka_unit_test(test_memory_has_a_limit),
        cmocka_unit_test(test_no_memory),
    };
    return cmocka_run_group_tests_name("scene_asset_pack", tests, NULL, NULL);
}
