// Messages with more optional fields than one bitmap has, against literal bytes.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "protocol/layout.h"

struct wide {
    uint8_t values[34];
    bool has[34];
};

static const struct hgp_layout *wide_layout(void)
{
    static struct hgp_field fields[34];
    static const struct hgp_layout layout = {"wide", fields, 34, sizeof(struct wide)};
    for (size_t i = 0; i < 34; i++)
        fields[i] =
            (struct hgp_field){"f", HGP_K_U8, HGP_P_OPT, 1, offsetof(struct wide, values) + i, 1,
                offsetof(struct wide, has) + i, .limit.u = {0, 255}};
    return &layout;
}

static enum hg_status decode_wide(const uint8_t *bytes, size_t size, struct wide *back)
{
    struct hgp_fault fault = {0};
    struct hg_reader r = hg_reader_make(bytes, size);
    return hgp_layout_decode(wide_layout(), 1, &r, NULL, back, &fault);
}

static void assert_wide(size_t first, size_t last, const uint8_t *want, size_t size)
{
    struct wide in = {0}, back;
    struct hg_writer w = {0};
    in.has[first] = in.has[last] = true;
    in.values[first] = 7;
    in.values[last] = 9;
    assert_int_equal(hgp_layout_encode(wide_layout(), 1, &w, &in, NULL), HG_OK);
    assert_int_equal(w.size, size);
    assert_memory_equal(w.data, want, size);
    assert_int_equal(decode_wide(w.data, w.size, &back), HG_OK);
    assert_memory_equal(&back, &in, sizeof in);
    hg_writer_finish(&w);
}

static void test_second_bitmap(void **state)
{
    (void)state;
    static const uint8_t first[] = {1, 0, 0, 0x80, 7, 9};
    static const uint8_t both[] = {2, 0, 0, 0, 7, 2, 0, 0, 0, 9};
    static const uint8_t second[] = {0, 0, 0, 0, 3, 0, 0, 0, 7, 9};
    static const uint8_t empty[] = {1, 0, 0, 0, 7, 0, 0, 0, 0},
                         unknown[] = {0, 0, 0, 0, 4, 0, 0, 0, 1};
    assert_wide(0, 31, first, sizeof first);
    assert_wide(1, 33, both, sizeof both);
    assert_wide(32, 33, second, sizeof second);
    struct wide back;
    assert_int_equal(decode_wide(both, 5, &back), HG_OK); // ends before it
    assert_int_equal(decode_wide(both, 7, &back), HG_E_FORMAT);
    assert_int_equal(decode_wide(both, 9, &back), HG_E_TRUNCATED);
    assert_int_equal(decode_wide(empty, sizeof empty, &back), HG_E_FORMAT);
    assert_int_equal(decode_wide(unknown, sizeof unknown, &back), HG_E_FORMAT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_second_bitmap)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
