// sample_blocks.c - pixels of settled pictures that need fewer samples than others; see
// recording.h.
#include "renderer/passes/sample_blocks.h"

#include "renderer/frame/batch/recording.h"

bool hg_batch_has_enough(const struct hg_batch *f)
{
    const struct hg_draw_blocks *blocks = f->draw->blocks;
    return blocks != NULL && f->draw->request->smaller == 0 && f->sample >= blocks->least;
}

static enum hg_status record(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    (void)user;
    if (!hg_batch_has_enough(f))
        return HG_OK;
    const struct hg_gpu_sample_blocks push = {
        f->draw->blocks->buffer.address, f->draw->blocks->columns, f->sample};
    return hg_sample_blocks_record(&f->pass, hg_graph_run_image(run, f->depth), &push, err);
}

void hg_batch_declare_blocks(struct hg_batch *f)
{
    if (f->draw->blocks == NULL || f->draw->request->smaller > 0)
        return;
    hg_batch_add(f, &(struct hg_graph_pass){.name = "sample blocks",
                        .record = record,
                        .accesses = {{f->depth, HG_GRAPH_DEPTH_KEEP, 0}}});
}
