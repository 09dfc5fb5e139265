// geometry_poses.c - skinning and morph targets on the device against a reference on the CPU.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/log.h"
#include "geometry_device.h"
#include "renderer/scene/load.h"
#include "tests/support/test_data.h"

static void reference_vertex(const struct hg_node *node, const struct hg_mesh_part *part,
    uint32_t v, const double anchor[3], double position[3], double normal[3])
{
    const float *weights = node->weights != NULL ? node->weights : node->mesh->weights;
    for (int c = 0; c < 3; c++) {
        position[c] = part->positions[v * 3 + (uint32_t)c];
        normal[c] = part->normals[v * 3 + (uint32_t)c];
        for (uint32_t t = 0; t < node->mesh->target_count; t++) {
            if (part->targets[t].positions != NULL)
                position[c] += (double)weights[t] * part->targets[t].positions[v * 3 + (uint32_t)c];
            if (part->targets[t].normals != NULL)
                normal[c] += (double)weights[t] * part->targets[t].normals[v * 3 + (uint32_t)c];
        }
    }
    if (node->skin == NULL)
        return;
    double m[16] = {0};
    for (uint32_t k = v * part->joint_sets * 4; k < (v + 1) * part->joint_sets * 4; k++) {
        double world[16], bind[16];
        hg_matrix_from_float(node->skin->joints[part->joints[k]]->world, world);
        hg_matrix_from_float(node->skin->inverse_bind[part->joints[k]], bind);
        hg_matrix_multiply(world, bind, world);
        for (int i = 0; i < 16; i++)
            m[i] += part->weights[k] * world[i];
    }
    double p[3], columns[3][3], cofactor[3][3], n[3];
    for (int r = 0; r < 3; r++) {
        p[r] = m[r] * position[0] + m[4 + r] * position[1] + m[8 + r] * position[2] + m[12 + r] -
               anchor[r];
        for (int c = 0; c < 3; c++)
            columns[c][r] = m[c * 4 + r];
    }
    for (int c = 0; c < 3; c++)
        geo_cross(columns[(c + 1) % 3], columns[(c + 2) % 3], cofactor[c]);
    for (int r = 0; r < 3; r++)
        n[r] = cofactor[0][r] * normal[0] + cofactor[1][r] * normal[1] + cofactor[2][r] * normal[2];
    memcpy(position, p, sizeof p);
    memcpy(normal, n, sizeof n);
}

static void read_output(struct geo *f, const struct hg_deform_entry *e, struct hg_gpu_buffer *back)
{
    geo_check(f, hg_gpu_buffer_create(
                     f->gpu, HG_GPU_BUFFER_READBACK, e->output_bytes, "posed", back, &f->err));
    struct hg_gpu_cmd *cmd;
    geo_check(f, hg_gpu_begin(f->gpu, &cmd, &f->err));
    const VkBufferCopy all = {0, 0, e->output_bytes};
    vkCmdCopyBuffer(hg_gpu_cmd_handle(cmd), e->output.handle, back->handle, 1, &all);
    hg_gpu_memory_barrier(cmd);
    geo_submit(f, cmd);
}

static void check_pose(struct geo *f, const struct hg_deform_entry *e, const char *name)
{
    const struct hg_mesh_part *part = &e->node_object->mesh->parts[e->part];
    struct hg_gpu_buffer back;
    read_output(f, e, &back);
    const float *positions = back.mapped;
    const struct hg_gpu_vertex *vertices =
        (const void *)((const uint8_t *)back.mapped + e->vertices_offset);
    double worst = 0, worst_normal = 0, size = 1e-3;
    for (uint32_t v = 0; v < e->vertex_count; v++) {
        double p[3], n[3], gap = 0, length = 0;
        float packed[3];
        reference_vertex(e->node_object, part, v, e->anchor, p, n);
        hg_unpack_normal(vertices[v].normal, packed);
        for (int c = 0; c < 3; c++) {
            size = fmax(size, fabs(p[c]));
            worst = fmax(worst, fabs(p[c] - positions[v * 3 + (uint32_t)c]));
            length += n[c] * n[c];
            // The bounds that culling uses hold every vertex.
            assert_true(positions[v * 3 + (uint32_t)c] >= e->bounds.min[c] - 1e-5 * size);
            assert_true(positions[v * 3 + (uint32_t)c] <= e->bounds.max[c] + 1e-5 * size);
        }
        for (int c = 0; c < 3; c++)
            gap = fmax(gap, fabs(n[c] / sqrt(length) - packed[c]));
        worst_normal = fmax(worst_normal, length > 1e-12 ? gap : 0);
    }
    print_message("%s: %u vertices, %u joints: position %.2e of the size, normal %.2e\n", name,
        e->vertex_count, e->joint_count, worst / size, worst_normal);
    assert_true(worst / size < 1e-5);
    assert_true(worst_normal < 2e-3);
    hg_gpu_buffer_destroy(f->gpu, &back);
}

static void check_file(struct geo *f, const char *path)
{
    const char *name = strrchr(path, '/') + 1;
    const struct hg_load_params params = {.path = path, .asset_number = 1, .scene_index = -1};
    struct hg_asset *asset;
    struct hg_scene *scene;
    struct hg_geometry *g;
    geo_check(f, hg_load_asset(&params, &asset, &f->err));
    geo_check(f, hg_scene_create(&scene));
    geo_check(f, hg_scene_add_asset(scene, asset, NULL));
    geo_check(f, hg_geometry_create(f->gpu, NULL, &g, &f->err));
    for (int step = 0; step < 3; step++) {
        geo_check(f, hg_asset_pose(asset, -1, 0.31 * step));
        geo_sync(f, g, scene);
        for (uint32_t i = 0; i < g->deforms.count; i++)
            check_pose(f, &g->deforms.items[i], name);
    }
    assert_true(g->deforms.count > 0);
    // The same pose again costs nothing.
    geo_sync(f, g, scene);
    struct hg_geometry_stats stats;
    hg_geometry_stats(g, &stats);
    assert_int_equal(stats.uploaded_bytes, 0);
    assert_int_equal(stats.deforms_changed, 0);
    hg_geometry_destroy(g);
    hg_scene_destroy(scene);
}

static void test_poses(void **state)
{
    check_file(*state, TEST_MODELS "/worm.glb");
    check_file(*state, TEST_MODELS "/morph.glb");
}

static void test_poses_of_samples(void **state)
{
    static const char *const names[] = {"khronos/CesiumMan/glTF-Binary/CesiumMan.glb",
        "khronos/Fox/glTF-Binary/Fox.glb", "khronos/SimpleSkin/glTF/SimpleSkin.gltf",
        "khronos/AnimatedMorphCube/glTF-Binary/AnimatedMorphCube.glb"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        check_file(*state, test_data(names[i]));
}

static void check_winding(
    struct geo *f, struct hg_geometry *g, struct hg_scene *scene, bool mirrored)
{
    geo_sync(f, g, scene);
    assert_true(g->draw_count > 0);
    for (uint32_t i = 0; i < g->draw_count; i++) {
        assert_true(g->draws[i].skinned);
        assert_int_equal((g->draws[i].gpu.flags & HG_DRAW_MIRRORED) != 0, mirrored);
    }
}

// Joints say which way triangles are wound, the node of the mesh does not.
static void test_mirrored_skeleton(void **state)
{
    struct geo *f = *state;
    const struct hg_load_params params = {
        .path = TEST_MODELS "/worm.glb", .asset_number = 1, .scene_index = -1};
    struct hg_asset *asset;
    struct hg_scene *scene;
    struct hg_geometry *g;
    geo_check(f, hg_load_asset(&params, &asset, &f->err));
    geo_check(f, hg_scene_create(&scene));
    geo_check(f, hg_scene_add_asset(scene, asset, NULL));
    geo_check(f, hg_geometry_create(f->gpu, NULL, &g, &f->err));
    check_winding(f, g, scene, false);
    struct hg_node *root = asset->skins[0]->joints[0];
    root->scale[0] = -root->scale[0];
    hg_scene_touch(scene, &root->head);
    check_winding(f, g, scene, true);
    for (uint32_t i = 0; i < g->deforms.count; i++) // a draw that is mirrored turns normals around
        check_pose(f, &g->deforms.items[i], "mirrored");
    for (uint32_t i = 0; i < asset->node_count; i++)
        if (asset->nodes[i]->mesh != NULL) {
            asset->nodes[i]->scale[1] = -1;
            hg_scene_touch(scene, &asset->nodes[i]->head);
        }
    check_winding(f, g, scene, true);
    root->scale[0] = -root->scale[0];
    hg_scene_touch(scene, &root->head);
    check_winding(f, g, scene, false);
    hg_geometry_destroy(g);
    hg_scene_destroy(scene);
}

int main(void)
{
    hg_log_set_sink(hg_log_sink_logfmt, (void *)(intptr_t)2);
    hg_log_set_level(HG_LOG_WARN);
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_poses),
        cmocka_unit_test(test_poses_of_samples), cmocka_unit_test(test_mirrored_skeleton)};
    return test_run_group(tests, geo_setup, geo_teardown);
}
