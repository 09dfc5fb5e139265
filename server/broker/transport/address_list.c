#include "server/broker/transport/address_list.h"

#include <arpa/inet.h>
#include <stdlib.h>
#include <string.h>

struct network {
    uint8_t bytes[16]; // IPv4 as ::ffff:a.b.c.d
    unsigned bits;
};

static bool parse_address(const char *text, size_t length, struct network *out)
{
    char copy[INET6_ADDRSTRLEN];
    struct in_addr v4;
    if (length >= sizeof copy)
        return false;
    memcpy(copy, text, length);
    copy[length] = 0;
    *out = (struct network){.bytes = {[10] = 0xff, [11] = 0xff}, .bits = 128};
    if (inet_pton(AF_INET, copy, &v4) == 1) {
        memcpy(out->bytes + 12, &v4, 4);
        return true;
    }
    char *zone = strchr(copy, '%'); // of a link-local address
    if (zone)
        *zone = 0;
    return inet_pton(AF_INET6, copy, out->bytes) == 1;
}

static bool parse_network(const char *text, struct network *out)
{
    const char *slash = strchr(text, '/');
    if (!parse_address(text, slash ? (size_t)(slash - text) : strlen(text), out))
        return false;
    if (!slash)
        return true;
    const bool is_v4 = !memchr(text, ':', (size_t)(slash - text));
    char *end;
    const unsigned long bits = strtoul(slash + 1, &end, 10);
    if (end == slash + 1 || *end || slash[1] < '0' || slash[1] > '9' || bits > (is_v4 ? 32 : 128))
        return false;
    out->bits = (unsigned)bits + (is_v4 ? 96 : 0);
    return true;
}

static bool is_within(const struct network *address, const struct network *network)
{
    const unsigned whole = network->bits / 8, rest = network->bits % 8;
    if (memcmp(address->bytes, network->bytes, whole) != 0)
        return false;
    return !rest || (address->bytes[whole] ^ network->bytes[whole]) >> (8 - rest) == 0;
}

enum hg_status hg_address_list_check(
    const struct hg_text_list *list, const char *option, struct hg_error *err)
{
    struct network network;
    for (size_t i = 0; i < list->count; i++)
        if (strcmp(list->items[i], "loopback") != 0 && strcmp(list->items[i], "none") != 0 &&
            !parse_network(list->items[i], &network))
            return hg_error_set(err, HG_E_INVAL, option, NULL,
                "'%.100s' is no address, network (10.0.0.0/8, fd00::/8), 'loopback' or 'none'",
                list->items[i]);
    return HG_OK;
}

bool hg_address_list_has(const struct hg_text_list *list, const char *address)
{
    struct network one, other;
    if (!parse_address(address, strlen(address), &one))
        return false;
    for (size_t i = 0; i < list->count; i++) {
        const bool loopback = strcmp(list->items[i], "loopback") == 0;
        if (parse_network(loopback ? "127.0.0.0/8" : list->items[i], &other) &&
            is_within(&one, &other))
            return true;
        if (loopback && parse_network("::1", &other) && is_within(&one, &other))
            return true;
    }
    return false;
}
