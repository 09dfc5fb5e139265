#include "renderer/scene/formats/import/collada_camera.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"

enum { NODES_MAX = 1024 }; // nested; the importer refuses deeper ones

static const double degree = 3.14159265358979323846 / 180;

// ---- tags --------------------------------------------------------------------------------------

struct tag {
    struct hg_text name, attributes;
    bool closes; // </name>
    bool empty;  // <name/>
};

static bool same(struct hg_text a, const char *b)
{
    const size_t n = strlen(b);
    return (size_t)(a.end - a.at) == n && memcmp(a.at, b, n) == 0;
}

// The end of the tag that begins at t->at: its '>', quoted ones not counted.
static const char *find_end(const struct hg_text *t)
{
    char quote = 0;
    for (const char *p = t->at; p < t->end; p++) {
        if (quote)
            quote = *p == quote ? 0 : quote;
        else if (*p == '"' || *p == '\'')
            quote = *p;
        else if (*p == '>')
            return p;
    }
    return NULL;
}

static bool skip_cdata(struct hg_text *t)
{
    static const char begin[] = "<![CDATA[";
    if ((size_t)(t->end - t->at) < sizeof begin - 1 || memcmp(t->at, begin, sizeof begin - 1) != 0)
        return false;
    const char *end = memmem(t->at, (size_t)(t->end - t->at), "]]>", 3);
    t->at = end ? end + 3 : t->end;
    return true;
}

// The next tag; what it encloses begins at t->at then. False at the end.
static bool next_tag(struct hg_text *t, struct tag *tag)
{
    do {
        t->at = t->at < t->end ? memchr(t->at, '<', (size_t)(t->end - t->at)) : NULL;
        if (!t->at)
            return false;
    } while (skip_cdata(t));
    const char *end = find_end(t);
    if (!end)
        return false;
    const char *p = t->at + 1;
    tag->closes = *p == '/';
    p += tag->closes;
    tag->empty = end > p && end[-1] == '/';
    struct hg_text inside = {p, end - tag->empty};
    tag->name = inside;
    while (inside.at < inside.end && !hg_text_is_space(*inside.at))
        inside.at++;
    tag->name.end = inside.at;
    tag->attributes = inside;
    t->at = end + 1;
    return true;
}

// The value of an attribute, empty where there is none.
static struct hg_text attribute(const struct tag *tag, const char *name)
{
    struct hg_text t = tag->attributes;
    while (t.at < t.end) {
        hg_text_skip_space(&t);
        struct hg_text key = t;
        while (t.at < t.end && *t.at != '=' && !hg_text_is_space(*t.at))
            t.at++;
        key.end = t.at;
        while (t.at < t.end && *t.at != '"' && *t.at != '\'')
            t.at++;
        if (t.at == t.end)
            break;
        const char quote = *t.at++;
        const char *end = memchr(t.at, quote, (size_t)(t.end - t.at));
        if (!end)
            break;
        if (same(key, name))
            return (struct hg_text){t.at, end};
        t.at = end + 1;
    }
    return (struct hg_text){t.end, t.end};
}

// ---- elements ----------------------------------------------------------------------------------

struct reader {
    struct hg_collada_cameras *out;
    struct hg_text nodes[NODES_MAX]; // ids of those that are open
    uint32_t depth;
    bool in_camera, in_optics;
    bool failed;
};

static bool grow(void **list, uint32_t count, size_t size)
{
    if (count & (count - 1))
        return true; // the room doubles at powers of two
    void *more = hg_realloc(*list, count ? (size_t)count * 2 : 1, size);
    if (more)
        *list = more;
    return more != NULL;
}

static void begin_camera(struct reader *r, const struct tag *tag)
{
    struct hg_collada_cameras *c = r->out;
    r->in_camera = false;
    if (tag->empty || c->camera_count == HG_COLLADA_CAMERAS_MAX)
        return;
    if (!grow((void **)&c->cameras, c->camera_count, sizeof *c->cameras)) {
        r->failed = true;
        return;
    }
    c->cameras[c->camera_count++] = (struct hg_collada_camera){.id = attribute(tag, "id")};
    r->in_camera = true;
}

static void add_use(struct reader *r, const struct tag *tag)
{
    struct hg_collada_cameras *c = r->out;
    struct hg_text url = attribute(tag, "url");
    if (url.at == url.end || *url.at != '#' || r->depth == 0 || r->depth > NODES_MAX ||
        c->use_count == HG_COLLADA_CAMERAS_MAX)
        return;
    if (!grow((void **)&c->uses, c->use_count, sizeof *c->uses)) {
        r->failed = true;
        return;
    }
    url.at++;
    c->uses[c->use_count++] = (struct hg_collada_camera_use){r->nodes[r->depth - 1], url, false};
}

static void open_node(struct reader *r, const struct tag *tag)
{
    struct hg_text name = attribute(tag, "id");
    if (tag->empty)
        return;
    if (name.at == name.end)
        name = attribute(tag, "sid");
    if (r->depth < NODES_MAX)
        r->nodes[r->depth] = name;
    r->depth++;
}

static void read_optics(struct reader *r, const struct tag *tag, struct hg_text value)
{
    struct hg_collada_optics *optics = &r->out->cameras[r->out->camera_count - 1].optics;
    double *to = same(tag->name, "xfov") || same(tag->name, "xmag")   ? &optics->x
                 : same(tag->name, "yfov") || same(tag->name, "ymag") ? &optics->y
                 : same(tag->name, "aspect_ratio")                    ? &optics->aspect
                 : same(tag->name, "znear")                           ? &optics->near
                 : same(tag->name, "zfar")                            ? &optics->far
                                                                      : NULL;
    double number;
    if (to && hg_text_number(&value, &number) && isfinite(number) && number > 0)
        *to = number;
}

static void read_unit(struct reader *r, const struct tag *tag)
{
    struct hg_text meter = attribute(tag, "meter");
    double number;
    if (hg_text_number(&meter, &number) && isfinite(number) && number > 0)
        r->out->unit_m = number;
}

static void take_close(struct reader *r, const struct tag *tag)
{
    if (same(tag->name, "node"))
        r->depth -= r->depth > 0;
    else if (same(tag->name, "camera"))
        r->in_camera = r->in_optics = false;
    else if (same(tag->name, "perspective") || same(tag->name, "orthographic"))
        r->in_optics = false;
}

static void take_open(struct reader *r, const struct tag *tag, struct hg_text value)
{
    if (same(tag->name, "node"))
        open_node(r, tag);
    else if (same(tag->name, "instance_camera"))
        add_use(r, tag);
    else if (same(tag->name, "unit"))
        read_unit(r, tag);
    else if (same(tag->name, "camera"))
        begin_camera(r, tag);
    else if (r->in_camera && !tag->empty && same(tag->name, "perspective"))
        r->in_optics = true;
    else if (r->in_camera && !tag->empty && same(tag->name, "orthographic"))
        r->in_optics = r->out->cameras[r->out->camera_count - 1].optics.orthographic = true;
    else if (r->in_camera && r->in_optics)
        read_optics(r, tag, value);
}

bool hg_collada_read_cameras(struct hg_text text, struct hg_collada_cameras *out)
{
    struct reader r = {.out = out};
    struct tag tag;
    *out = (struct hg_collada_cameras){.unit_m = 1};
    while (!r.failed && next_tag(&text, &tag)) {
        if (tag.closes)
            take_close(&r, &tag);
        else
            take_open(&r, &tag, text);
    }
    if (r.failed)
        hg_collada_cameras_finish(out);
    return !r.failed;
}

void hg_collada_cameras_finish(struct hg_collada_cameras *cameras)
{
    hg_free(cameras->cameras);
    hg_free(cameras->uses);
    *cameras = (struct hg_collada_cameras){.unit_m = 1};
}

// ---- lookup ------------------------------------------------------------------------------------

static const struct hg_collada_optics *find_optics(
    const struct hg_collada_cameras *cameras, struct hg_text id)
{
    for (uint32_t i = 0; i < cameras->camera_count; i++) {
        const struct hg_collada_camera *c = &cameras->cameras[i];
        const size_t n = (size_t)(id.end - id.at);
        if ((size_t)(c->id.end - c->id.at) == n && memcmp(c->id.at, id.at, n) == 0)
            return &c->optics;
    }
    return NULL;
}

// A node that is instanced several times holds its camera each time: the last one counts again.
const struct hg_collada_optics *hg_collada_next_camera(
    struct hg_collada_cameras *cameras, const char *node)
{
    const struct hg_collada_optics *last = NULL;
    for (int named = 1; named >= 0 && !last; named--)
        for (uint32_t i = 0; i < cameras->use_count; i++) {
            struct hg_collada_camera_use *use = &cameras->uses[i];
            const struct hg_collada_optics *optics = find_optics(cameras, use->camera);
            if (!optics || !same(use->node, named ? node : ""))
                continue;
            last = optics;
            if (use->taken)
                continue;
            use->taken = true;
            return optics;
        }
    return last;
}

// ---- meaning -----------------------------------------------------------------------------------

static bool is_angle(double degrees)
{
    return degrees > 0.01 && degrees < 179.9;
}

// Width / height as stated, or by both sides; 0: neither.
static double stated_aspect(const struct hg_collada_optics *optics, double x, double y)
{
    const double aspect = x > 0 && y > 0 ? x / y : optics->aspect;
    return aspect > 1e-3 && aspect < 1e3 ? aspect : 0;
}

bool hg_collada_vertical_angle(
    const struct hg_collada_optics *optics, double aspect_else, float *vfov_rad, float *aspect)
{
    const double tan_x = is_angle(optics->x) ? tan(optics->x * degree / 2) : 0;
    const double tan_y = is_angle(optics->y) ? tan(optics->y * degree / 2) : 0;
    if (optics->orthographic || (tan_x == 0 && tan_y == 0))
        return false;
    const double stated = stated_aspect(optics, tan_x, tan_y);
    *aspect = (float)stated;
    *vfov_rad = (float)(2 * atan(tan_y > 0 ? tan_y : tan_x / (stated > 0 ? stated : aspect_else)));
    return true;
}

bool hg_collada_half_height(const struct hg_collada_optics *optics, double unit_m,
    double aspect_else, float *half_height, float *aspect)
{
    const double stated = stated_aspect(optics, optics->x, optics->y);
    const double half = optics->y > 0 ? optics->y : optics->x / (stated > 0 ? stated : aspect_else);
    *half_height = (float)(half * unit_m);
    *aspect = (float)stated;
    return optics->orthographic && *half_height > 0 && isfinite(*half_height);
}
