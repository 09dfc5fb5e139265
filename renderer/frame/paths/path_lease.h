// path_lease.h - limits how many views of a scene trace paths for their pictures at rest.
// Floor 4. Thread: the render thread.
//
// A view at rest meters its exposure and gathers light with paths. Their waves and films, and the
// ray structures of the view's camera, take a hundred MiB and more whatever the size of the
// picture. So at most HG_PATH_LEASES views of a scene hold a lease; others at rest wait until one
// of these is done or moves. Views that are not displayed before they are settled, are path-traced
// or have planes need no lease.
#ifndef HG_RENDERER_FRAME_PATHS_PATH_LEASE_H
#define HG_RENDERER_FRAME_PATHS_PATH_LEASE_H

#include <stdbool.h>

struct hg_view_state;

// Takes or renews a lease. False: all are held by other views; to be tried again.
bool hg_path_lease_take(struct hg_view_state *view);
// The view draws a picture in motion: after a second of motion its paths are freed.
void hg_path_lease_note_motion(struct hg_view_state *view);
// Gives the lease up, as the view ends.
void hg_path_lease_end(struct hg_view_state *view);

#endif
