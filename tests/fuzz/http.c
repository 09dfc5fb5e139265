// Heads of HTTP: whatever comes, what is taken lies within it, and no prefix of a head is another.
#include <stdlib.h>
#include <string.h>

#include "protocol/http.h"
#include "tests/fuzz/fuzz.h"

static void is_within(struct hg_http_text part, const uint8_t *data, size_t size)
{
    const uint8_t *at = (const uint8_t *)part.data;
    if (part.size && (at < data || at > data + size || part.size > (size_t)(data + size - at)))
        abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct hg_http_head head, before;
    struct hg_http_text value;
    enum hg_status status = hg_http_request_parse(data, size, &head);
    if (!status) {
        is_within(head.target, data, size);
        is_within(head.query, data, size);
        for (size_t i = 0; i < head.field_count; i++) {
            is_within(head.fields[i].name, data, size);
            is_within(head.fields[i].value, data, size);
        }
        if (head.bytes > size || head.bytes > HG_HTTP_HEAD_BYTES ||
            hg_http_find(&head, "host", &value) > 1 ||
            hg_http_request_parse(data, head.bytes - 1, &before) == HG_OK)
            abort();
        hg_http_lists(&head, "Connection", "upgrade");
    } else if (status != HG_E_AGAIN && (!head.reason || head.status < 400)) {
        abort();
    }
    status = hg_http_response_parse(data, size, &head);
    if (status && status != HG_E_AGAIN && !head.reason)
        abort();
    return 0;
}
