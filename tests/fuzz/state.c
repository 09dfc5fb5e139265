// The state log: its file format, its records, and the edits in them. Checksums keep mutations out
// of the records, so the same bytes are also read as records of their own: u16 size, body.
#include <string.h>

#include "server/broker/scene/scene_journal.h"
#include "server/broker/state/state_file.h"
#include "server/broker/state/state_record.h"
#include "tests/fuzz/fuzz.h"

static void take_record(struct hg_journal *journal, const uint8_t *body, size_t size)
{
    struct hg_state_record record;
    if (hg_state_record_decode(body, size, &record) || record.kind != HG_STATE_EDIT ||
        !hg_journal_wants(record.of.edit.type))
        return;
    const struct hgp_bytes *payload = &record.of.edit.payload;
    struct hg_packet *packet = hg_packet_create(
        &(struct hgp_header){.type = record.of.edit.type, .length = payload->size});
    if (!packet)
        return;
    if (payload->size)
        memcpy(packet->payload, payload->data, payload->size);
    struct hg_journal_stats before = hg_journal_get_stats(journal);
    if (hg_journal_accept(journal, packet) == HG_E_FORMAT) // and nothing of it stays
        FUZZ_CHECK(hg_journal_get_stats(journal).entries == before.entries);
    hg_packet_unref(packet);
}

static void read_file(struct hg_journal *journal, const uint8_t *data, size_t size)
{
    struct hg_reader r = hg_reader_make(data, size);
    const uint8_t *body;
    size_t body_size;
    if (hg_state_header_decode(&r))
        return;
    while (hg_state_record_next(&r, &body, &body_size) == HG_OK) {
        FUZZ_CHECK(body >= data && body_size <= size && body + body_size <= data + size);
        take_record(journal, body, body_size);
    }
    FUZZ_CHECK(r.pos <= size);
}

static void read_bodies(struct hg_journal *journal, const uint8_t *data, size_t size)
{
    struct hg_reader r = hg_reader_make(data, size);
    while (!r.failed && r.pos < r.size) {
        size_t body_size = hg_read_u16(&r);
        if (body_size > r.size - r.pos)
            body_size = r.size - r.pos;
        take_record(journal, hg_read_bytes(&r, body_size), body_size);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct hg_journal *journal = hg_journal_create(NULL);
    if (!journal)
        return 0;
    read_file(journal, data, size);
    read_bodies(journal, data, size);
    hg_journal_destroy(journal);
    return 0;
}
