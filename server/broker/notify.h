// notify.h - tells the service manager how the daemon is (sd_notify without libsystemd).
// Floor 6 (broker). Thread: the loop. Source: sd_notify(3), the NOTIFY_SOCKET protocol.
#ifndef HG_BROKER_NOTIFY_H
#define HG_BROKER_NOTIFY_H

#include <stdint.h>

#include "base/status.h"

// Sends e.g. "READY=1\nSTATUS=..." to $NOTIFY_SOCKET; nothing happens without one.
void hg_notify_send(const char *fmt, ...) HG_PRINTF(1, 2);
// Half of $WATCHDOG_USEC in ns when it is meant for this process; 0 = no watchdog.
uint64_t hg_notify_watchdog_ns(void);
// Number of sockets passed by the service manager ($LISTEN_FDS, from descriptor 3 on); the
// variables are removed from the environment. Bit i of *tls: the name of the i-th is "tls"
// ($LISTEN_FDNAMES, FileDescriptorName= of a systemd.socket).
int hg_notify_take_sockets(uint64_t *tls);

#endif
