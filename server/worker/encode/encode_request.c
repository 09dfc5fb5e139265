#include "server/worker/encode/encode_request.h"

#include "base/alloc.h"

void hg_encode_request_destroy(struct encode_request *request)
{
    if (!request)
        return;
    for (uint32_t i = 0; i < request->plane_count; i++)
        hg_refbuf_unref(request->planes[i].values);
    for (uint32_t i = 0; i < ENCODE_MATTES; i++)
        hg_cryptomatte_view_finish(&request->mattes[i]);
    hg_depth_grid_destroy(request->depth);
    hg_refbuf_unref(request->pixels);
    hg_free(request);
}
