#include "client/cli/render/frame_list.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"

struct parser {
    const char *what, *text, *at;
    struct hg_error *err;
};

static enum hg_status wrong(const struct parser *p, const char *expected)
{
    return hg_error_set(p->err, HG_E_INVAL, p->what, NULL, "'%s': character %zu: %s", p->text,
        (size_t)(p->at - p->text) + 1, expected);
}

static void skip_blanks(struct parser *p)
{
    p->at += strspn(p->at, " \t");
}

static enum hg_status parse_number(struct parser *p, bool is_signed, int32_t *out)
{
    const bool negative = is_signed && *p->at == '-';
    const char *digits = p->at + negative;
    const size_t length = strspn(digits, "0123456789");
    const char *const expected = is_signed ? "a frame number is expected" : "a step is expected";
    if (length == 0)
        return wrong(p, expected);
    const long value = length > 9 ? HG_FRAME_NUMBER_MAX + 1L : strtol(digits, NULL, 10);
    if (value > HG_FRAME_NUMBER_MAX)
        return wrong(p, "the number has more than 8 digits");
    *out = (int32_t)(negative ? -value : value);
    p->at = digits + length;
    return HG_OK;
}

static uint32_t count_of(const struct hg_frame_range *range)
{
    return (uint32_t)((range->last - range->first) / range->step) + 1;
}

// What follows the first number of a range.
static enum hg_status parse_rest(struct parser *p, struct hg_frame_range *range)
{
    int32_t last, step = 1;
    p->at += *p->at == '-' ? 1 : 2;
    enum hg_status status = parse_number(p, true, &last);
    if (status)
        return status;
    if (*p->at == 'x' || *p->at == ':') {
        p->at++;
        const char *const begin = p->at;
        status = parse_number(p, false, &step);
        if (status)
            return status;
        if (step == 0) {
            p->at = begin;
            return wrong(p, "the step is 0");
        }
    }
    const int32_t distance = last - range->first;
    range->step = distance < 0 ? -step : step;
    range->last = range->first + distance / range->step * range->step;
    return HG_OK;
}

static enum hg_status parse_item(struct parser *p, struct hg_frame_range *range)
{
    skip_blanks(p);
    enum hg_status status = parse_number(p, true, &range->first);
    range->last = range->first;
    range->step = 1;
    if (!status && (*p->at == '-' || strncmp(p->at, "..", 2) == 0))
        status = parse_rest(p, range);
    if (status)
        return status;
    skip_blanks(p);
    return *p->at && *p->at != ',' ? wrong(p, "a comma or the end is expected") : HG_OK;
}

enum hg_status hg_frame_ranges_parse(
    const char *what, const char *text, struct hg_frame_ranges *out, struct hg_error *err)
{
    struct parser p = {what, text, text, err};
    enum hg_status status = HG_OK;
    uint64_t frames = 0;
    for (uint32_t i = 0; i < out->count; i++)
        frames += count_of(&out->items[i]);
    for (bool more = true; !status && more;) {
        struct hg_frame_range range;
        const char *const begin = p.at;
        status = parse_item(&p, &range);
        if (status)
            break;
        frames += count_of(&range);
        if (out->count == HG_FRAME_RANGES_MAX || frames > HG_FRAME_LIST_MAX) {
            p.at = begin;
            status = wrong(&p, out->count == HG_FRAME_RANGES_MAX
                                   ? "more than 256 parts"
                                   : "this makes more than 1000000 frames");
            break;
        }
        out->items[out->count++] = range;
        more = *p.at == ',';
        p.at += more;
    }
    out->count = status ? 0 : out->count;
    return status;
}

static bool has(const struct hg_frame_range *range, int32_t number)
{
    const bool inside = range->step > 0 ? number >= range->first && number <= range->last
                                        : number <= range->first && number >= range->last;
    return inside && (number - range->first) % range->step == 0;
}

enum hg_status hg_frame_ranges_list(
    const struct hg_frame_ranges *ranges, int32_t **numbers, uint32_t *count, struct hg_error *err)
{
    size_t all = 0;
    *count = 0;
    for (uint32_t i = 0; i < ranges->count; i++)
        all += count_of(&ranges->items[i]);
    *numbers = hg_calloc(all > 0 ? all : 1, sizeof **numbers);
    if (!*numbers)
        return hg_error_set(err, HG_E_NOMEM, "--frames", NULL, "no memory for so many");
    for (uint32_t i = 0; i < ranges->count; i++) {
        const struct hg_frame_range *range = &ranges->items[i];
        for (uint32_t k = 0; k < count_of(range); k++) {
            const int32_t number = range->first + (int32_t)k * range->step;
            bool before = false;
            for (uint32_t j = 0; j < i && !before; j++)
                before = has(&ranges->items[j], number);
            if (!before)
                (*numbers)[(*count)++] = number;
        }
    }
    return HG_OK;
}

// The longest run of even steps at numbers[0]; two frames are a run only where they are neighbours.
static uint32_t run_length(const int32_t *numbers, uint32_t count)
{
    uint32_t n = 1;
    if (count < 2)
        return n;
    const int32_t step = numbers[1] - numbers[0];
    while (n < count && numbers[n] - numbers[n - 1] == step)
        n++;
    return n == 2 && step != 1 ? 1 : n;
}

void hg_frame_list_text(const int32_t *numbers, uint32_t count, char *dst, size_t size)
{
    size_t used = 0;
    dst[0] = 0;
    for (uint32_t i = 0; i < count;) {
        char item[48];
        const uint32_t n = run_length(numbers + i, count - i);
        const int32_t step = n > 1 ? abs(numbers[i + 1] - numbers[i]) : 1;
        const char *const comma = used > 0 ? "," : "";
        int length = snprintf(item, sizeof item, "%s%d", comma, numbers[i]);
        if (n > 1)
            length = snprintf(item, sizeof item, "%s%d-%d", comma, numbers[i], numbers[i + n - 1]);
        if (step > 1)
            length += snprintf(item + length, sizeof item - (size_t)length, "x%d", step);
        if (used + (size_t)length + sizeof ",..." > size) {
            snprintf(dst + used, size - used, ",...");
            return;
        }
        memcpy(dst + used, item, (size_t)length + 1);
        used += (size_t)length;
        i += n;
    }
}
