#include "tests/attack/tenant_rig.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/clock.h"

void tenant_rig_init(struct daemon *d)
{
    daemon_init_tokens(d);
    daemon_write(d, "tokens",
        "anna-token-1 edit anna\nanna-token-2 edit anna\nbert-token-1 edit bert\n"
        "guest-token-1 view guest tenant=anna scenes=show*\nnameless-token view\n"
        "admin-token-1 admin\n");
    daemon_option(d, "isolation", "tenant");
    daemon_option(d, "restart-delay", "0.01");
}

void tenant_enter(struct peer *p, struct daemon *d, const char *token, const char *scene)
{
    peer_enter(p, d, token);
    if (scene)
        peer_scene(p, scene);
}

pid_t tenant_worker(struct daemon *d, const char *tenant)
{
    struct peer admin;
    char wanted[160], state[16];
    int pid = 0;
    tenant_enter(&admin, d, "admin-token-1", NULL);
    peer_call(&admin, HGP_T_sessions_query, &(struct hgp_sessions_query){0}, HGP_T_json);
    char *text = strndup(admin.m.json.text.data, admin.m.json.text.size);
    snprintf(wanted, sizeof wanted, "\"tenant\":\"%s\"", tenant);
    for (const char *at = text; !pid && (at = strstr(at, "{\"state\":")); at++) {
        const char *end = strchr(at, '}'), *whose = strstr(at, wanted);
        if (whose && whose < end &&
            sscanf(at, "{\"state\":\"%15[a-z]\",\"pid\":%d", state, &pid) == 2)
            pid = strcmp(state, "up") == 0 ? pid : 0;
    }
    free(text);
    peer_close(&admin);
    return pid;
}

pid_t tenant_await_worker(struct daemon *d, const char *tenant, pid_t other_than)
{
    uint64_t deadline_ns = hg_clock_now_ns() + 60000000000u;
    for (;;) {
        pid_t pid = tenant_worker(d, tenant);
        if (pid && pid != other_than)
            return pid;
        assert_true(hg_clock_now_ns() < deadline_ns);
        usleep(20000);
    }
}
