// The script language of helio run. Whatever the parser accepts can be sent.
#include <string.h>

#include "base/alloc.h"
#include "client/cli/run/script.h"
#include "tests/fuzz/fuzz.h"

static const char *variable(void *user, const char *file, const char *name, size_t length)
{
    (void)user;
    (void)file;
    return length == 4 && memcmp(name, "DATA", 4) == 0 ? "some/where" : NULL;
}

static const struct hg_cli_script_source source = {.variable = variable};

static void check_sendable(enum hgp_type type, const void *message)
{
    struct hg_writer w = {0};
    FUZZ_CHECK(
        hgp_encode(&w, HGP_VERSION_MAX, (struct hgp_envelope){type, 1, 0}, message, NULL) == HG_OK);
    hg_writer_finish(&w);
}

static void check_step(const struct hg_cli_step *step)
{
    FUZZ_CHECK(step->line > 0 && step->text);
    if (step->kind == HG_CLI_STEP_VIEW) {
        struct hgp_view_set view = step->view;
        view.view = 1;
        check_sendable(HGP_T_view_set, &view);
    } else if (step->kind == HG_CLI_STEP_CAMERA) {
        struct hgp_view_camera camera = step->camera;
        camera.view = 1;
        check_sendable(HGP_T_view_camera, &camera);
    } else if (step->kind == HG_CLI_STEP_NODE) {
        struct hgp_node_set node = step->node;
        node.node = 1;
        check_sendable(HGP_T_node_set, &node);
    } else if (step->kind == HG_CLI_STEP_MATERIAL) {
        struct hgp_material_set material = step->material;
        material.material = 1;
        check_sendable(HGP_T_material_set, &material);
    } else if (step->kind == HG_CLI_STEP_ENVIRONMENT) {
        check_sendable(HGP_T_environment_set, &step->environment);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char *text = hg_calloc(size + 1, 1); // exact, so that a read behind the end is seen
    if (!text)
        return 0;
    if (size)
        memcpy(text, data, size);
    struct hg_cli_script script;
    struct hg_error err = {0};
    enum hg_status status = hg_cli_script_parse("fuzz", text, &source, &script, &err);
    if (status)
        FUZZ_CHECK(status == HG_E_INVAL && err.reason[0] && strncmp(err.what, "fuzz", 4) == 0);
    for (size_t i = 0; !status && i < script.count; i++)
        check_step(&script.steps[i]);
    hg_cli_script_finish(&script);
    hg_free(text);
    return 0;
}
