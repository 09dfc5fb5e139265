// suspect.h - identifies a request that ended a worker, so that it is recognised in any session.
// Floor 6 (broker). Thread: the loop.
//
//   asset_load, environment_set   each of its files, by hash or path, so that other files beside it
//                                 make no difference; of more than HG_SUSPECT_FILES the first ones
//                                 and their number
//   mesh_set, texture_set,        their data without ids, which differ from session to session; of
//   compare, image_query          much data a part
//   queries of a named scene      the whole query, and the scene's name
//
// Nothing of frames and small edits is kept: what is wrong with them is the scene.
#ifndef HG_BROKER_SUSPECT_H
#define HG_BROKER_SUSPECT_H

#include "server/broker/session/session_state.h"

enum { HG_SUSPECT_FILES = 32 };

// `only_known`: data are looked at only where something of that kind and size is in the quarantine.
// Calls `take` for each; one that returns false is the last.
void hg_suspect_each(const struct hg_session *session, const struct hg_packet *packet,
    bool only_known, bool (*take)(void *user, const struct hg_quarantine_entry *entry), void *user);

#endif
