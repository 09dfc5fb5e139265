// broker.h - heliod: all its parts put together, its start, reload and end.
// Floor 6, private to server/broker. Everything runs on one thread and nothing blocks.
//
// Includes and calls go downwards only. What has something to say to those above it calls a table
// of functions that it was given (hg_conn_events, hg_link_events).
//
// Layers, lowest first:
//   counters latency folder_lock
//   web_files                                    what HTTP serves
//   loop options audit auth notify list peer_log disk_queue upload_folder    the system's side
//   cache_folder                                 which one the daemon uses
//   proxy_header                                 the PROXY protocol
//   address_list                                 addresses in options
//   upload_store                                 contents
//   transport state_file                         bytes of a peer; of the state log
//   tls                                          TLS
//   http_answer ws_transport                     HTTP: requests to answers; WebSocket
//   http_transport                               streams of HTTP
//   detect                                       HGP or HTTP
//   proxied                                      behind a proxy; all that an entry is
//   packet listener peer_table state_folder      whole messages; where clients come in, and from
//   upload                                       a content that arrives
//   state_log                                    what survives the daemon, synced in groups
//   state_record
//   quarantine                                   files that ended workers
//   slots conn_turn                              who gets a connection; whose turn it is
//   cgroup privileges call_filter                control groups; the daemon's user, its calls
//   worker_share                                 what of the machine a worker gets
//   disk_watch                                   what workers have on the disk
//   worker_home                                  the folders of a worker
//   worker_process confine                       its arguments; what its process may do
//   config_check                                 what a configuration is checked for
//   launcher                                     the process that starts them
//   conn worker_link scene_journal               a client; a worker; accepted edits
//   conn_admission conn_share conn_time          who may stay; memory for output; time limits
//   worker_pool                                  which worker a scene goes to
//   annotation block_list join_ticket pixel_rate  texts in scenes; who is let in; frames per second
//   scene                                        scenes by name
//   session_state                                what is kept of sessions
//   session_audit session_record session_allow
//   session_sync                                 answers that wait for the disk
//   session_view session_upload
//   session_look                                 how views show the scene
//   suspect                                      by what requests are known again
//   trial
//   session_request session_rules session_list    to the worker; what is refused; who is there
//   session_end
//   session_annotation session_camera session_ticket
//   session_share session_admin                  people in a scene; administrators
//   session_park
//   session                                      begin and end, the client's messages
//   session_answer resume                        what the worker says; on another connection
//   metrics                                      statistics
//   web                                          what HTTP serves, put together
//   recovery client_dispatch state               a new worker; a client's messages; restarts
//   handover                                     all of it, for the next program
//   takeover                                     SIGUSR2
//   broker                                       start, signals, reload, the janitor, drain
//   main
#ifndef HG_BROKER_BROKER_H
#define HG_BROKER_BROKER_H

#include "server/broker/client_dispatch.h"
#include "server/broker/state/takeover.h"

// What streams are made of.
struct hg_broker_streams {
    struct hg_web web;
    struct hg_tls tls;
};

// What lets in beside the file of tokens, and what is refused although it is there.
struct hg_guests {
    struct hg_quarantine quarantine; // files that are not
    struct hg_join_tickets tickets;
    struct hg_block_list blocks;
};

// Of periodic work.
struct hg_ticks {
    uint64_t due_ns, wait_ns; // the next; between two while there are clients
    uint64_t tokens_checked_ns;
};

struct hg_broker {
    struct hg_loop loop;
    struct hg_options options;
    int argc;
    char *const *argv; // for reloads
    struct hg_tokens tokens;
    struct hg_audit audit;
    struct hg_guests guests;
    struct hg_cache_folder cache;
    struct hg_upload_store *store;
    struct hg_listener *listeners;
    struct hg_source signals;
    struct hg_state_log *state;
    struct hg_source state_news;
    struct hg_admission admission;
    struct hg_broker_streams streams;
    struct hg_conn_table conns;
    struct hg_session_table sessions;
    struct hg_launcher launcher;
    struct hg_machine machine;
    struct hg_worker_pool pool;
    struct hg_takeover takeover;
    struct hg_broker_watchdog {
        uint64_t interval_ns, sent_ns; // of the service manager; 0 = there is none
    } watchdog;
    struct hg_ticks ticks;
    uint64_t drain_deadline_ns;
};

// Runs until drained; returns the exit code. Options are taken over.
int hg_broker_run(struct hg_options *options, int argc, char *const *argv);

#endif
