// state_file.h - the format of the state log: a header, then records with checksums.
// Floor 6 (broker). Pure: bytes in, records out.
//
//   header  8 bytes "HELIOLOG", u32 version, u32 CRC-32C of these 12 bytes
//   record  u32 bytes of the body, u32 CRC-32C of those 4 bytes and of the body, body
// All little-endian. What was not written completely (a torn tail) ends the log: the first record
// that is cut or does not match its checksum, and all behind it, count as not written.
#ifndef HG_BROKER_STATE_FILE_H
#define HG_BROKER_STATE_FILE_H

#include "base/bytes.h"

enum {
    HG_STATE_VERSION = 1,
    HG_STATE_HEADER_BYTES = 16,
    HG_STATE_PREFIX_BYTES = 8,       // of a record, before its body
    HG_STATE_BODY_LIMIT = 768 << 20, // above every message that a client may send
};

void hg_state_header_encode(uint8_t out[HG_STATE_HEADER_BYTES]);
// HG_OK and the reader behind the header; HG_E_TRUNCATED: the beginning of one, or nothing;
// HG_E_FORMAT: something else; HG_E_VERSION: of another version.
enum hg_status hg_state_header_decode(struct hg_reader *r) HG_MUST_CHECK;

// The prefix of a record whose body is `head` and, behind it, `rest`.
void hg_state_prefix_encode(uint8_t out[HG_STATE_PREFIX_BYTES], const void *head, size_t head_size,
    const void *rest, size_t rest_size);
// The next record; *body borrows the reader's bytes. HG_E_AGAIN: there is no more; HG_E_TRUNCATED,
// HG_E_HASH: the rest was not written completely, and the reader stays where that begins.
enum hg_status hg_state_record_next(
    struct hg_reader *r, const uint8_t **body, size_t *size) HG_MUST_CHECK;
// Behind the record at which hg_state_record_next stopped there is a whole one: that record is not
// the end of what was written, it is damaged.
bool hg_state_record_is_followed(struct hg_reader r);

#endif
