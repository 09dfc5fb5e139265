#include "server/broker/http/web.h"

#include <string.h>
#include <unistd.h>

#include "base/program.h"
#include "server/broker/metrics/metrics.h"

static const char *unready(void *user)
{
    return hg_metrics_unready(user);
}

static void write_metrics(void *user, struct hg_writer *w)
{
    hg_metrics_write(user, w);
}

enum hg_status hg_web_open(struct hg_web *web, const struct hg_options *options,
    struct hg_session_table *sessions, struct hg_error *err)
{
    char folder[4096];
    *web = (struct hg_web){
        .options = options, .unready = unready, .metrics = write_metrics, .user = sessions};
    if (options->web_root)
        return strcmp(options->web_root, "off") == 0
                   ? HG_OK
                   : hg_web_files_read(options->web_root, &web->files, err);
    hg_program_prefix_path("share/helio/web", folder, sizeof folder);
    return access(folder, R_OK) == 0 ? hg_web_files_read(folder, &web->files, err) : HG_OK;
}
