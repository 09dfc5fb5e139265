// collada_text.h - Collada files as the importer needs them: UTF-8, and single blanks.
// Floor 2, private to scene/. Any thread.
#ifndef HG_RENDERER_SCENE_FORMATS_IMPORT_COLLADA_TEXT_H
#define HG_RENDERER_SCENE_FORMATS_IMPORT_COLLADA_TEXT_H

#include "base/refbuf.h"

// A copy in UTF-8 (from UTF-16 of either byte order, with or without its mark) that begins at the
// first element. Comments are gone. White space in the text of elements is one blank where there
// was any, none at its ends; that in tags likewise. Byte order marks and no-break spaces count as
// white space. HG_E_LIMIT, HG_E_NOMEM.
enum hg_status hg_collada_clean(const struct hg_refbuf *in, uint64_t limit_bytes, const char *label,
    struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;

#endif
