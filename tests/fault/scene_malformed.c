// Every adversarial asset ends in success or a named refusal, in bounded time and memory; what the
// glTF validator's report calls an error is refused or named in a warning.
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <cmocka.h>

#include <jansson.h>
#include <sys/resource.h>
#include <time.h>

#include "renderer/scene/asset.h"
#include "tests/unit/scene_corpus.h"

enum { SECONDS_PER_FILE = 60 }; // of the processor: a busy machine makes no file slow

static struct corpus corpus;

static bool is_warned(const struct hg_asset *asset, const char *code, const char *pointer)
{
    size_t n = strlen(code);
    for (uint32_t i = 0; i < asset->warning_count; i++) {
        const struct hg_warning *w = &asset->warnings[i];
        if (strncmp(w->reason, code, n) == 0 || (pointer && strcmp(w->where, pointer) == 0))
            return true;
    }
    return false;
}

// Errors of the report that a loaded asset does not name.
static int check_report(const char *path, const struct hg_asset *asset, int *checked)
{
    char report[1200];
    snprintf(report, sizeof report, "%s.report.json", path);
    json_t *root = json_load_file(report, 0, NULL);
    json_t *messages = json_object_get(json_object_get(root, "issues"), "messages"), *message;
    int missed = 0;
    size_t i;
    json_array_foreach(messages, i, message)
    {
        if (json_integer_value(json_object_get(message, "severity")) != 0)
            continue;
        const char *code = json_string_value(json_object_get(message, "code"));
        const char *pointer = json_string_value(json_object_get(message, "pointer"));
        ++*checked;
        if (!asset || is_warned(asset, code, pointer))
            continue;
        printf("MISSED %-45s %-60s %s\n", code, pointer ? pointer : "", strrchr(path, '/') + 1);
        missed++;
    }
    json_decref(root);
    return missed;
}

static void test_malformed(void **state)
{
    (void)state;
    corpus_collect(&corpus, "malformed");
    assert_true(corpus.count > 50);
    int missed = 0, checked = 0, loaded = 0;
    for (size_t i = 0; i < corpus.count; i++) {
        struct hg_asset *asset = NULL;
        struct hg_error err = {0};
        struct hg_load_params params = {.path = corpus.files[i],
            .asset_number = 1,
            .scene_index = -1,
            .memory_limit_bytes = 256u << 20};
        struct timespec start, end;
        assert_int_equal(clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &start), 0);
        enum hg_status status = hg_load_asset(&params, &asset, &err);
        assert_int_equal(clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &end), 0);
        if (end.tv_sec - start.tv_sec > SECONDS_PER_FILE)
            fail_msg("%s took %lld s", corpus.files[i], (long long)(end.tv_sec - start.tv_sec));
        assert_true((status == HG_OK) == (asset != NULL));
        if (status &&
            (!err.what[0] || !err.reason[0] ||
                (!err.where[0] && status == HG_E_FORMAT && strstr(err.reason, "root") == NULL)))
            printf("UNPLACED %s: '%s' '%s'\n", corpus.files[i], err.where, err.reason);
        if (getenv("HELIO_VERBOSE"))
            printf("%-50s %s %s %s\n", strrchr(corpus.files[i], '/') + 1, hg_status_name(status),
                err.where, err.reason);
        loaded += status == HG_OK;
        missed += check_report(corpus.files[i], asset, &checked);
        hg_asset_destroy(asset);
    }
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    printf("%zu files, %d loaded, %d reported errors, %d not named, peak %ld MiB\n", corpus.count,
        loaded, checked, missed, usage.ru_maxrss / 1024);
    assert_int_equal(missed, 0);
    corpus_finish(&corpus);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_malformed)};
    return test_run_group(tests, NULL, NULL);
}
