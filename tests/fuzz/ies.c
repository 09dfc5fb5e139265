// The reader of photometric files.
#include <math.h>
#include <string.h>

#include "renderer/scene/light_table.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct hg_light_table *table;
    struct hg_error err = {0};
    const enum hg_status status = hg_light_profile_read_ies("fuzz.ies", data, size, &table, &err);
    if (status) {
        FUZZ_CHECK(!table && err.what[0] && err.reason[0]);
        FUZZ_CHECK(status == HG_E_LIMIT || strncmp(err.where, "line ", 5) == 0);
        return 0;
    }
    FUZZ_CHECK(isfinite(table->peak_cd) && table->peak_cd >= 0);
    FUZZ_CHECK(table->solid_angle >= 0 && table->solid_angle < 13);
    for (int i = 0; i < 64; i++) {
        const float a = (float)i * 0.7f, z = (float)(i % 9) / 4 - 1, r = sqrtf(fmaxf(1 - z * z, 0));
        const float d[3] = {r * cosf(a), r * sinf(a), z};
        const float factor = hg_light_profile_at(table->words, d);
        FUZZ_CHECK(factor >= 0 && factor <= 1.001f);
    }
    hg_light_table_unref(table);
    return 0;
}
