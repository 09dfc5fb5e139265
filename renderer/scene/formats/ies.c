// Photometric files (IES LM-63): a head of lines up to TILT=, then numbers.
#include <math.h>
#include <stdio.h>

#include "base/alloc.h"
#include "renderer/math/vec.h"
#include "renderer/scene/formats/text_scan.h"
#include "renderer/scene/light_table.h"

enum { MOST_ANGLES = 4096, TYPE_C = 1, TYPE_B = 2, TYPE_A = 3 };

struct ies {
    const char *name, *begin;
    struct hg_text text;
    struct hg_error *err;
    double *vertical, *horizontal; // [vertical_count], [horizontal_count] degrees, ascending
    double *candela;               // [horizontal_count][vertical_count]
    uint32_t vertical_count, horizontal_count;
    int type;
    double scale; // of all candela
};

// --- text ----------------------------------------------------------------------------------------

static enum hg_status fail(const struct ies *f, enum hg_status status, const char *what)
{
    char place[32];
    unsigned line = 1;
    for (const char *c = f->begin; c < f->text.at; c++)
        line += *c == '\n' || (*c == '\r' && !(c + 1 < f->text.end && c[1] == '\n'));
    snprintf(place, sizeof place, "line %u", line);
    return hg_error_set(f->err, status, f->name, place, "%s", what);
}

static enum hg_status number(struct ies *f, const char *what, double *out)
{
    char reason[96];
    while (f->text.at < f->text.end && (hg_text_is_space(*f->text.at) || *f->text.at == ','))
        f->text.at++;
    if (hg_text_number(&f->text, out) && isfinite(*out))
        return HG_OK;
    snprintf(reason, sizeof reason, "a number is missing: %s", what);
    return fail(f, HG_E_FORMAT, reason);
}

static enum hg_status numbers(
    struct ies *f, const char *what, double *out, uint32_t count, bool ascend)
{
    for (uint32_t i = 0; i < count; i++) {
        const enum hg_status status = number(f, what, &out[i]);
        if (status)
            return status;
        if (ascend && i > 0 && !(out[i] > out[i - 1]))
            return fail(f, HG_E_FORMAT, "angles have to ascend");
    }
    return HG_OK;
}

// A count that what is left of the file has room for: at least two characters a number.
static enum hg_status count_of(struct ies *f, const char *what, uint32_t most, uint32_t *out)
{
    double value;
    enum hg_status status = number(f, what, &value);
    if (status)
        return status;
    if (!(value >= 1 && value <= most) || value != floor(value) ||
        value > (double)(f->text.end - f->text.at) / 2 + 1) {
        char reason[96];
        snprintf(
            reason, sizeof reason, "%.9g is no %s, or the file is too short for it", value, what);
        return fail(f, HG_E_FORMAT, reason);
    }
    *out = (uint32_t)value;
    return HG_OK;
}

static bool begins_with(struct hg_text line, const char *word)
{
    for (; *word; word++, line.at++)
        if (line.at >= line.end || *line.at != *word)
            return false;
    return true;
}

// Lamp and luminaire tilt: a geometry, angles and their factors. What is lit is the luminaire as it
// was measured, so that they are passed over.
static enum hg_status skip_tilt(struct ies *f)
{
    double value;
    uint32_t count = 0;
    enum hg_status status = number(f, "the geometry of TILT=INCLUDE", &value);
    if (!status)
        status = count_of(f, "number of tilt angles", MOST_ANGLES, &count);
    for (uint32_t i = 0; i < 2 * count && !status; i++)
        status = number(f, "a tilt angle or its factor", &value);
    return status;
}

static enum hg_status skip_head(struct ies *f)
{
    struct hg_text line;
    while (hg_text_line(&f->text, &line)) {
        line = hg_text_trim(line);
        if (begins_with(line, "TILT="))
            return begins_with(line, "TILT=INCLUDE") ? skip_tilt(f) : HG_OK;
    }
    return fail(f, HG_E_FORMAT, "this is no IES LM-63 file: no line begins with TILT=");
}

// --- the file ------------------------------------------------------------------------------------

static enum hg_status read_counts(struct ies *f)
{
    double lamps, lumens, type, rest[4], ballast, future, watts;
    enum hg_status status = number(f, "the number of lamps", &lamps);
    if (!status)
        status =
            number(f, "lumens per lamp", &lumens); // candela are those of the lamps as they are
    if (!status)
        status = number(f, "the candela multiplier", &f->scale);
    if (!status)
        status = count_of(f, "number of vertical angles", MOST_ANGLES, &f->vertical_count);
    if (!status)
        status = count_of(f, "number of horizontal angles", MOST_ANGLES, &f->horizontal_count);
    if (!status)
        status = number(f, "the photometric type", &type);
    if (status)
        return status;
    f->type = type == 1 ? TYPE_C : type == 2 ? TYPE_B : type == 3 ? TYPE_A : 0;
    if (f->type == 0)
        return fail(f, HG_E_FORMAT, "the photometric type is 1 (C), 2 (B) or 3 (A)");
    status = numbers(f, "units and size of the luminaire", rest, 4, false);
    if (!status)
        status = number(f, "the ballast factor", &ballast);
    if (!status)
        status = number(f, "the ballast-lamp photometric factor", &future);
    if (!status)
        status = number(f, "input watts", &watts);
    if (status)
        return status;
    // Of the editions before 1995; later it is reserved, and 1.
    f->scale *= ballast * (future > 0 ? future : 1);
    if (!(f->scale > 0 && f->scale < 1e12))
        return fail(f, HG_E_FORMAT, "candela multiplier and ballast factor have to be above 0");
    return HG_OK;
}

static enum hg_status check_angles(struct ies *f)
{
    const double v0 = f->vertical[0], v1 = f->vertical[f->vertical_count - 1];
    const double h0 = f->horizontal[0], h1 = f->horizontal[f->horizontal_count - 1];
    const bool c = f->type == TYPE_C;
    if (v0 < (c ? 0 : -90) || v1 > (c ? 180 : 90))
        return fail(f, HG_E_FORMAT, "vertical angles lie outside of those of the photometric type");
    if (c && f->horizontal_count > 1 && !(h0 == 0 && h1 >= 90 && h1 <= 360) &&
        !(h0 == 90 && h1 == 270))
        return fail(
            f, HG_E_FORMAT, "horizontal angles go from 0 to 90, 180 or 360, or from 90 to 270");
    if (!c && (h0 < -90 || h1 > 90))
        return fail(
            f, HG_E_FORMAT, "horizontal angles lie outside of those of the photometric type");
    return HG_OK;
}

static enum hg_status read_data(struct ies *f)
{
    const uint64_t count = (uint64_t)f->vertical_count * f->horizontal_count;
    if (count + f->vertical_count + f->horizontal_count >
        (uint64_t)(f->text.end - f->text.at) / 2 + 1)
        return fail(f, HG_E_FORMAT, "the file is too short for its numbers of angles");
    f->vertical = hg_calloc(f->vertical_count, sizeof *f->vertical);
    f->horizontal = hg_calloc(f->horizontal_count, sizeof *f->horizontal);
    f->candela = hg_calloc(count, sizeof *f->candela);
    if (!f->vertical || !f->horizontal || !f->candela)
        return fail(f, HG_E_NOMEM, "no memory for candela");
    enum hg_status status = numbers(f, "a vertical angle", f->vertical, f->vertical_count, true);
    if (!status)
        status = numbers(f, "a horizontal angle", f->horizontal, f->horizontal_count, true);
    if (!status)
        status = check_angles(f);
    if (!status)
        status = numbers(f, "a candela value", f->candela, (uint32_t)count, false);
    for (uint64_t i = 0; i < count && !status; i++)
        if (!(f->candela[i] >= 0 && f->candela[i] < 1e12))
            status = fail(f, HG_E_FORMAT, "candela values are 0 or more");
    return status;
}

// --- directions ----------------------------------------------------------------------------------

// Where a value lies among ascending ones; false: outside.
static bool place(const double *angles, uint32_t count, double at, uint32_t *first, double *part)
{
    *first = 0;
    *part = 0;
    if (count == 1)
        return true;
    if (at < angles[0] - 1e-9 || at > angles[count - 1] + 1e-9)
        return false;
    uint32_t low = 0, high = count - 1;
    while (high - low > 1) {
        const uint32_t middle = (low + high) / 2;
        if (angles[middle] <= at)
            low = middle;
        else
            high = middle;
    }
    *first = low;
    *part = fmin(fmax((at - angles[low]) / (angles[high] - angles[low]), 0), 1);
    return true;
}

static double row_at(const struct ies *f, uint32_t row, uint32_t first, double part)
{
    const double *values = f->candela + (size_t)row * f->vertical_count + first;
    return f->vertical_count == 1 ? values[0] : values[0] + (values[1] - values[0]) * part;
}

// A horizontal angle of type C, 0..360, as those of the file have it: the planes that are left out
// mirror others.
static double fold(const struct ies *f, double h)
{
    const double first = f->horizontal[0], last = f->horizontal[f->horizontal_count - 1];
    if (first == 90) // about the plane of 90 and 270 degrees
        return h < 90 ? 180 - h : h > 270 ? 540 - h : h;
    if (last <= 90)
        h = h > 180 ? 360 - h : h;
    if (last <= 90)
        return h > 90 ? 180 - h : h;
    return last <= 180 && h > 180 ? 360 - h : h;
}

static double candela_at(const struct ies *f, double h, double v)
{
    uint32_t column, row;
    double across, along;
    const uint32_t rows = f->horizontal_count;
    if (f->type == TYPE_C)
        h = fold(f, h);
    if (f->type != TYPE_C && f->vertical[0] >= 0)
        v = fabs(v); // symmetric
    if (f->type != TYPE_C && f->horizontal[0] >= 0)
        h = fabs(h);
    if (!place(f->vertical, f->vertical_count, v, &column, &along))
        return 0;
    if (!place(f->horizontal, rows, h, &row, &across)) {
        if (f->type != TYPE_C)
            return 0;
        // A full turn whose last plane is the first one, which the file leaves out.
        const double last = f->horizontal[rows - 1], gap = 360 - last;
        across = gap > 0 ? (h - last) / gap : 0;
        return row_at(f, rows - 1, column, along) * (1 - across) +
               row_at(f, 0, column, along) * across;
    }
    const double low = row_at(f, row, column, along);
    return rows == 1 ? low : low + (row_at(f, row + 1, column, along) - low) * across;
}

// Candela in a direction of the light's frame, which points along -z. The vertical plane is that of
// x and z, and horizontal angles run from there to +y in type C, to -y in B and A (EXT_lights_ies,
// "Coordinate System Mapping"): B is turned about the horizontal axis first, A about the vertical
// one.
static double candela_towards(const struct ies *f, double theta, double phi)
{
    const double deg = 180 / HG_PI;
    if (f->type == TYPE_C)
        return candela_at(f, phi * deg, theta * deg);
    const double x = sin(theta) * cos(phi), y = sin(theta) * sin(phi), ahead = cos(theta);
    if (f->type == TYPE_B)
        return candela_at(f, asin(fmin(fmax(-y, -1), 1)) * deg, atan2(x, ahead) * deg);
    return candela_at(f, atan2(-y, ahead) * deg, asin(fmin(fmax(x, -1), 1)) * deg);
}

// --- the table -----------------------------------------------------------------------------------

static double least_step(const double *angles, uint32_t count)
{
    double least = 360;
    for (uint32_t i = 1; i < count; i++)
        least = fmin(least, angles[i] - angles[i - 1]);
    return least;
}

static enum hg_status make_table(const struct ies *f, struct hg_light_table **out)
{
    const double step = least_step(f->vertical, f->vertical_count);
    const double turn = least_step(f->horizontal, f->horizontal_count);
    const bool round = f->type == TYPE_C && f->horizontal_count == 1;
    const uint32_t thetas = step < 0.49 ? 721 : step < 0.99 ? 361 : 181;
    const uint32_t phis = round ? 1 : turn < 2.4 ? 360 : 144;
    float *factors = hg_calloc((size_t)thetas * phis, sizeof *factors);
    double most = 0;
    if (!factors)
        return fail(f, HG_E_NOMEM, "no memory for a profile");
    for (uint32_t p = 0; p < phis; p++)
        for (uint32_t t = 0; t < thetas; t++) {
            const double v = candela_towards(f, t * HG_PI / (thetas - 1), p * 2 * HG_PI / phis);
            factors[(size_t)p * thetas + t] = (float)v;
            most = fmax(most, v);
        }
    enum hg_status status = hg_light_profile_create(factors, thetas, phis, out);
    hg_free(factors);
    if (status == HG_E_INVAL)
        return fail(f, HG_E_FORMAT, "all candela values are 0");
    if (status)
        return fail(f, status, "no memory for a profile");
    (*out)->peak_cd = (float)(most * f->scale);
    return HG_OK;
}

enum hg_status hg_light_profile_read_ies(const char *name, const void *bytes, size_t size,
    struct hg_light_table **out, struct hg_error *err)
{
    struct ies f = {.name = name, .begin = bytes, .err = err};
    f.text = (struct hg_text){f.begin, f.begin + size};
    *out = NULL;
    if (size > HG_LIGHT_PROFILE_MOST_BYTES)
        return hg_error_set(err, HG_E_LIMIT, name, NULL, "a photometric file has at most %d bytes",
            HG_LIGHT_PROFILE_MOST_BYTES);
    enum hg_status status = skip_head(&f);
    if (!status)
        status = read_counts(&f);
    if (!status)
        status = read_data(&f);
    if (!status)
        status = make_table(&f, out);
    hg_free(f.vertical);
    hg_free(f.horizontal);
    hg_free(f.candela);
    return status;
}
