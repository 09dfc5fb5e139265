// config_check.h - what a configuration is checked for, by --check-config, at the start and on
// reload. Floor 6 (broker). Thread: the loop. Nothing is made, opened for good or changed.
#ifndef HG_BROKER_CONFIG_CHECK_H
#define HG_BROKER_CONFIG_CHECK_H

#include "server/broker/connection/auth.h"
#include "server/broker/options.h"
#include "server/broker/transport/tls.h"

// The tokens that `options` name; without a file none.
enum hg_status hg_config_read_tokens(
    const struct hg_options *options, struct hg_tokens *out, struct hg_error *err) HG_MUST_CHECK;
// The listeners have what they need: tokens, a certificate.
enum hg_status hg_config_check_listen(const struct hg_options *options,
    const struct hg_tokens *tokens, struct hg_error *err) HG_MUST_CHECK;
// Logs what is not wrong and should not stay so: secrets that others may read, certificates that
// expire.
void hg_config_warn(
    const struct hg_options *options, const struct hg_tokens *tokens, const struct hg_tls *tls);
// Logs which of its files the daemon cannot read again now that it runs as `user`.
void hg_config_warn_unreadable(const struct hg_options *options, const char *user);
// All that reload applies: listeners, tokens, certificates, addresses, levels of the log. What is
// good is warned about, too.
enum hg_status hg_config_check(
    const struct hg_options *options, struct hg_error *err) HG_MUST_CHECK;
// What a start needs besides: user, programs, folders. HG_E_NOTFOUND, HG_E_PERM, HG_E_INVAL.
enum hg_status hg_config_check_start(
    const struct hg_options *options, struct hg_error *err) HG_MUST_CHECK;

#endif
