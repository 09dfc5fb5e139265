// planes.c - the list behind --aov.
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "client/cli/render/render.h"

enum { PLANE_COUNT = HGP_COUNT_plane, NAME_BYTES = 32 };

#define BIT(name) (1u << HGP_plane_##name)

// Names that stand for several planes.
static const struct {
    const char *name;
    uint32_t bits;
} groups[] = {
    {"direct", BIT(DIRECT_DIFFUSE) | BIT(DIRECT_SPECULAR) | BIT(DIRECT_TRANSMISSION)},
    {"indirect", BIT(INDIRECT_DIFFUSE) | BIT(INDIRECT_SPECULAR) | BIT(INDIRECT_TRANSMISSION)},
    {"cryptomatte", BIT(CRYPTO_OBJECT) | BIT(CRYPTO_MATERIAL) | BIT(CRYPTO_ASSET)},
    {"all", (1u << PLANE_COUNT) - 1 - BIT(COLOR) - BIT(LIGHT_GROUPS) - BIT(NOISY)},
};

// What only paths that follow light know.
static const uint32_t of_light = BIT(DIRECT_DIFFUSE) | BIT(DIRECT_SPECULAR) |
                                 BIT(DIRECT_TRANSMISSION) | BIT(INDIRECT_DIFFUSE) |
                                 BIT(INDIRECT_SPECULAR) | BIT(INDIRECT_TRANSMISSION) |
                                 BIT(LIGHT_GROUPS) | BIT(VARIANCE) | BIT(NOISY);

static uint32_t bits_of(const char *name)
{
    uint32_t value;
    for (size_t i = 0; i < sizeof groups / sizeof *groups; i++)
        if (strcasecmp(name, groups[i].name) == 0)
            return groups[i].bits;
    if (!hgp_enum_value("plane", name, &value) || value == HGP_plane_COLOR)
        return 0;
    return 1u << value;
}

// "albedo normal ... direct indirect cryptomatte all": what has a group goes by its group, as an
// error has room for 255 bytes.
static void list_names(char *dst, size_t size)
{
    const uint32_t grouped = groups[0].bits | groups[1].bits | groups[2].bits;
    size_t used = 0;
    for (uint32_t i = HGP_plane_COLOR + 1; i < PLANE_COUNT && used < size; i++)
        if (!(grouped >> i & 1))
            used += (size_t)snprintf(dst + used, size - used, "%s ", hgp_enum_name("plane", i));
    for (char *c = dst; *c; c++)
        *c = (char)(*c == '_' ? '-' : *c >= 'A' && *c <= 'Z' ? *c + 32 : *c);
    for (size_t i = 0; i < sizeof groups / sizeof *groups && used < size; i++)
        used += (size_t)snprintf(dst + used, size - used, "%s ", groups[i].name);
    dst[strlen(dst) - 1] = 0;
}

enum hg_status hg_cli_parse_planes(
    const char *what, const char *text, bool path, uint32_t *out, struct hg_error *err)
{
    *out = 0;
    for (const char *at = text;;) {
        char name[NAME_BYTES], known[400];
        size_t length = strcspn(at, ",");
        snprintf(name, sizeof name, "%.*s", (int)length, at);
        uint32_t bits = length < sizeof name ? bits_of(name) : 0;
        if (!bits) {
            *out = 0;
            list_names(known, sizeof known);
            return hg_error_set(err, HG_E_INVAL, what, NULL,
                "'%s' is none of: %s; or a part such as direct-diffuse, crypto-object", name,
                known);
        }
        if (!path && strcasecmp(name, "all") == 0)
            bits &= ~of_light;
        if (!path && (bits & of_light)) {
            *out = 0;
            return hg_error_set(err, HG_E_INVAL, what, NULL, "'%s' needs mode path", name);
        }
        *out |= bits;
        if (!at[length])
            return HG_OK;
        at += length + 1;
    }
}
