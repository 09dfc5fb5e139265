// film.h - what a frame is made from and goes with; checkpoints.
// Floor 6, private to server/worker. Thread: the render thread. A handler answers its request.
#ifndef HG_SERVER_WORKER_FILM_H
#define HG_SERVER_WORKER_FILM_H

#include "server/worker/request.h"

void hg_handle_job_query(const struct request *r);
void hg_handle_checkpoint_query(const struct request *r);
void hg_handle_checkpoint_set(const struct request *r);

// Planes of the protocol to those of the renderer and bits of enum hg_matte_kind. HG_E_UNSUPPORTED
// names one that there is not.
enum hg_status film_planes(
    uint32_t bits, uint32_t *planes, uint32_t *mattes, struct hg_error *err) HG_MUST_CHECK;
// Of the frame that the view would give when settled, in an encoding.
enum hg_status film_job(struct render_state *s, struct session *session, struct view_slot *view,
    enum hgp_encoding encoding, uint8_t quality, uint8_t hash[32],
    struct hg_error *err) HG_MUST_CHECK;
// Fills notes and planes of a frame that is about to be encoded, and frame.job.
enum hg_status film_attach(struct render_state *s, struct session *session, struct view_slot *view,
    struct encode_request *job, struct hg_error *err) HG_MUST_CHECK;

#endif
