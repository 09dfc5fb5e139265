// helio.h - libhelio: talk to a Heliograph daemon, or to a private worker, from C.
//
// Floor 6. Links only hg_base and hg_protocol; knows no renderer. A `struct helio` belongs to one
// thread at a time; different ones are independent. Only helio_interrupt may be called from
// anywhere, signal handlers included.
//
// Messages are the structs of protocol/hgp.h (`struct hgp_<name>`), made from the table
// protocol/messages.def, which is also the reference of docs/protocol.md.
//
// Blocking use:
//     struct helio *h;
//     helio_connect(&(struct helio_options){.url = "unix:/run/heliod.sock"}, &h, &err);
//     helio_scene_open(h, "", &scene, &err);
//     helio_load(h, scene.first_id, "demo:", &loaded, &err);
//     helio_call(h, HGP_T_view_set, &view, NULL, &err);
//     helio_frame(h, &request, &frame, &err);            // frame->body->frame.data
//     helio_message_free(frame);
//     helio_destroy(h);
//
// Non-blocking use: helio_start; then, whenever helio_fd is readable (or writable while
// helio_want_write), helio_process, and helio_next until it says HG_E_AGAIN.
//
// Errors: fallible functions return a status of base/status.h, set their outputs to zero on failure
// and fill *err (may be NULL) with words for people. HG_E_AGAIN is flow, not failure. A connection
// that failed stays failed: every later call returns the same status.
//
// Strings and bytes given to a function are borrowed for the call only.
#ifndef HELIO_HELIO_H
#define HELIO_HELIO_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#include "base/status.h"
#include "protocol/hgp.h"

#define HELIO_API __attribute__((visibility("default")))

struct helio; // one connection

#define HELIO_NO_TIMEOUT UINT64_MAX

// ---- connecting --------------------------------------------------------------------------------

// Zero is the default of every member.
struct helio_options {
    const char *url;                // unix:PATH, tcp:HOST:PORT, tls:HOST:PORT,
                                    // ws://HOST[:PORT][/PATH][?QUERY] or wss://..., at most 255
                                    // bytes; NULL = start a private worker
    const char *token;              // NULL = none; needed when the daemon requires one
    const char *client;             // name for the daemon's logs; default "libhelio/VERSION"
    uint64_t timeout_ns;            // until the session is open; default 30 s
    uint32_t max_receive_bytes;     // greatest payload taken; default HGP_LIMIT_OPEN_DEFAULT
    const char *worker;             // private worker's program; default HELIO_WORKER of the
                                    // environment, else ../libexec/helio-worker beside this program
    const char *const *worker_args; // its arguments after --fd 3, NULL-terminated; NULL = none
    uint64_t reconnect_ns;          // when the connection to a daemon is lost, or the daemon was
                                    // restarted, try for so long to go on; 0 = do not (see below)
    const char *tls_ca;             // tls, wss: file (PEM) of authorities that may have signed the
                                    // daemon's certificate; NULL = those of the system
    const char *tls_pin;            // SHA-256 of the daemon's certificate in 64 digits: that one
                                    // is trusted, whoever has signed it
    const char *tls_cert, *tls_key; // the client's own (PEM); key NULL = in the same file
    bool tls_insecure;              // takes any certificate: whoever is in between reads along
    const char *scene;              // ws, wss: the scene that is going to be opened, at most 128
                                    // bytes; a load balancer sees it in the request (/hgp?scene=),
                                    // unless `url` has one. NULL = none. It opens nothing
};

// Going on with a session (reconnect_ns): the connection is made again and the daemon gives back
// the session with its scene, ids, views and subscriptions; meanwhile the state is
// HELIO_CONNECTING or HELIO_GREETING again, and helio_fd may be -1: call helio_process every 100 ms
// at least. Blocking calls that can be repeated without harm are; the others (loads, removals,
// batches, uploads, opening and closing) fail with HG_E_CLOSED: they may have been done. Requests
// that were sent with helio_send get no answer any more when `reconnects` has risen.

enum helio_state {
    HELIO_CONNECTING, // the transport is being set up
    HELIO_GREETING,   // hello, authentication, or a worker that starts
    HELIO_OPEN,       // messages may be sent
    HELIO_CLOSED,     // over; helio_process says why
};

struct helio_info {
    enum helio_state state;
    enum hgp_role role;
    uint16_t version;           // of the protocol
    uint64_t session;           // number in the daemon's logs; 0 with a private worker
    uint32_t max_message_bytes; // greatest payload the other side takes
    const char *server;         // program and version; lives as long as the connection
    const char *device;         // private worker: JSON object of its device; else ""
    int worker_pid;             // private worker: its process; else 0
    bool draining;              // the server stops soon
    const char *scene;          // with a join ticket: the only one that may be opened; else ""
    uint32_t reconnects;        // so often the session went on on another connection
};

// "0.1.0".
HELIO_API const char *helio_version(void);

// Starts to connect and returns at once; names of hosts are looked up in a thread of the library.
// The rest happens in helio_process. HG_E_INVAL (url), HG_E_NOTFOUND, HG_E_CLOSED (no listener),
// HG_E_LIMIT (no thread or descriptors), HG_E_NOMEM, HG_E_IO, HG_E_WORKER (the worker's program
// cannot be started).
HELIO_API enum hg_status helio_start(
    const struct helio_options *options, struct helio **out, struct hg_error *err) HG_MUST_CHECK;

// As helio_start, on a stream socket that is connected to a daemon already (a tunnel, a pair);
// options->url only names it in messages. Owns `fd` from here on, also on failure.
HELIO_API enum hg_status helio_start_fd(const struct helio_options *options, int fd,
    struct helio **out, struct hg_error *err) HG_MUST_CHECK;

// helio_start, then waits until the session is open. Also HG_E_TIMEOUT, HG_E_AUTH, HG_E_VERSION,
// HG_E_CLOSED (unreachable), HG_E_CANCELLED.
HELIO_API enum hg_status helio_connect(
    const struct helio_options *options, struct helio **out, struct hg_error *err) HG_MUST_CHECK;

// Closes, ends a private worker (waits up to 2 s for it, then kills it) and frees. Accepts NULL.
HELIO_API void helio_destroy(struct helio *h);

HELIO_API void helio_get_info(const struct helio *h, struct helio_info *out);

// ---- non-blocking use --------------------------------------------------------------------------

// The descriptor to poll; may change while HELIO_CONNECTING. -1 when closed.
HELIO_API int helio_fd(const struct helio *h);
// True while bytes wait to be sent (or a connection is being made): poll for writing too.
HELIO_API bool helio_want_write(const struct helio *h);
// Reads and writes what is possible now; never blocks. HG_OK, or why the connection ended.
// Stops reading while 256 messages (or max_receive_bytes) wait to be taken with helio_next; call it
// again when they are taken, also when nothing new arrives: TLS holds bytes of its own.
HELIO_API enum hg_status helio_process(struct helio *h, struct hg_error *err) HG_MUST_CHECK;

// Queues a message. `type` goes to the server and needs HELIO_OPEN. *request (may be NULL) becomes
// the id that its answers carry; with NULL no answer is wanted.
// HG_E_AGAIN: 8 MiB wait to be sent already, or the connection is being made again: process first.
// HG_E_INVAL names the field at fault;
// HG_E_LIMIT: larger than the other side takes; HG_E_STATE; HG_E_NOMEM.
HELIO_API enum hg_status helio_send(struct helio *h, enum hgp_type type, const void *message,
    uint32_t *request, struct hg_error *err) HG_MUST_CHECK;

// A received message; everything in `body` lives until helio_message_free.
struct helio_message {
    enum hgp_type type;
    uint32_t request;          // 0 = not an answer
    uint32_t size_bytes;       // of its payload
    const union hgp_any *body; // the member named by `type`
    uint64_t begun_ns;         // when its first bytes were read and
    uint64_t received_ns;      // when all of it was; CLOCK_MONOTONIC
};

// Takes the oldest received message. HG_E_AGAIN: none (or the connection's error once it failed and
// none is left).
HELIO_API enum hg_status helio_next(
    struct helio *h, struct helio_message **out, struct hg_error *err) HG_MUST_CHECK;
HELIO_API void helio_message_free(struct helio_message *message); // accepts NULL
// What a message of type HGP_T_error says, with the limit that was reached and when to ask again
// (struct hg_error): for those that helio_next gives. Returns its status; HG_OK: of another type.
HELIO_API enum hg_status helio_message_error(
    const struct helio *h, const struct helio_message *message, struct hg_error *err);

// Says that a frame of a subscription has come (`frame`: of type HGP_T_frame, with request 0), and
// when, and gives credit for one more: for views with `names`. The daemon then keeps as many frames
// under way as the network delivers, of the quality that it has room for. Subscribe with credit for
// all that may be under way (32 suit round trips of up to a second). helio_ping now and then tells
// it the round trip. Errors of helio_send.
HELIO_API enum hg_status helio_taken(
    struct helio *h, const struct helio_message *frame, struct hg_error *err) HG_MUST_CHECK;

// ---- blocking use ------------------------------------------------------------------------------

// Called inside blocking calls: for messages that accompany a request, and `tick` at least once a
// second while an answer is awaited. Each may be NULL.
struct helio_handlers {
    void *user;
    void (*tick)(void *user);
    void (*progress)(void *user, const struct hgp_progress *progress);
    void (*notice)(void *user, const struct hgp_notice *notice);
    // Called wherever messages are read. Without them these wait for helio_next, unless many do.
    void (*message)(void *user, const struct hgp_message *message);   // of an administrator
    void (*idle)(void *user, const struct hgp_idle_warning *warning); // the session ends soon
};

HELIO_API void helio_set_handlers(struct helio *h, const struct helio_handlers *handlers);

// Sees what helio_send takes (the whole message with its header, as it goes out) and what comes for
// the caller, before it is taken: for recordings and protocols of a conversation. Tokens and
// tickets do not pass here. Each may be NULL; NULL as a whole ends it. Must not call this library.
struct helio_tap {
    void *user;
    void (*sent)(void *user, const uint8_t *message, size_t size);
    void (*received)(void *user, const struct helio_message *message);
};

HELIO_API void helio_set_tap(struct helio *h, const struct helio_tap *tap);

// Deadline of each blocking call below; default HELIO_NO_TIMEOUT.
HELIO_API void helio_set_timeout(struct helio *h, uint64_t timeout_ns);

// Makes the running and the next blocking call return HG_E_CANCELLED. Async-signal-safe.
HELIO_API void helio_interrupt(struct helio *h);

// Waits until something arrived, was sent, or the time is over. HG_E_TIMEOUT, HG_E_CANCELLED, or
// why the connection ended.
HELIO_API enum hg_status helio_wait(
    struct helio *h, uint64_t timeout_ns, struct hg_error *err) HG_MUST_CHECK;

// Waits until everything queued has been handed to the system.
HELIO_API enum hg_status helio_flush(struct helio *h, struct hg_error *err) HG_MUST_CHECK;

// Sends and waits for the answer. An `error` answer becomes its status and *err. *answer (may be
// NULL when it does not matter) is freed with helio_message_free. Messages that belong to other
// requests stay for helio_next; progress and notices go to the handlers. What comes for a call that
// was interrupted, or had its deadline, is dropped: the server may still do what it was asked for.
HELIO_API enum hg_status helio_call(struct helio *h, enum hgp_type type, const void *message,
    struct helio_message **answer, struct hg_error *err) HG_MUST_CHECK;

// As helio_call; any answer but `answer_type` is HG_E_FORMAT.
HELIO_API enum hg_status helio_call_for(struct helio *h, enum hgp_type type, const void *message,
    enum hgp_type answer_type, struct helio_message **answer, struct hg_error *err) HG_MUST_CHECK;

// Round trip. *rtt_ns in nanoseconds.
HELIO_API enum hg_status helio_ping(
    struct helio *h, uint64_t *rtt_ns, struct hg_error *err) HG_MUST_CHECK;

// Joins the scene `name`, or makes it; "" = a private one. A private worker has private ones only.
// HG_E_STATE: a scene is open; the message scene_close leaves it, and the next one is empty.
HELIO_API enum hg_status helio_scene_open(struct helio *h, const char *name,
    struct hgp_scene_opened *out, struct hg_error *err) HG_MUST_CHECK;

// Loads a file that the server can see. `asset` is a number of the range of scene_opened.
HELIO_API enum hg_status helio_load(struct helio *h, uint32_t asset, const char *path,
    struct hgp_asset_loaded *out, struct hg_error *err) HG_MUST_CHECK;

// A file of this machine whose content the server shall have.
struct helio_file {
    const char *path; // here
    const char *uri;  // as the asset names it, percent-decoded
    uint8_t hash[32]; // out: SHA-256 of its content
};

// Sends the contents that the server does not have yet, in pieces; fills the hashes.
// *sent_bytes (may be NULL) counts what went over the wire. HG_E_LIMIT: a file above 4 GiB.
HELIO_API enum hg_status helio_upload(struct helio *h, struct helio_file *files, uint32_t count,
    uint64_t *sent_bytes, struct hg_error *err) HG_MUST_CHECK;

// One frame of a view; body->frame of *out.
HELIO_API enum hg_status helio_frame(struct helio *h, const struct hgp_frame_request *request,
    struct helio_message **out, struct hg_error *err) HG_MUST_CHECK;

// Asks which camera shows the scene (view_fit) and writes it to *camera: either the node of a
// camera of the scene, or eye, target, up and lens. The other members stay as they are.
HELIO_API enum hg_status helio_camera_fit(struct helio *h, const struct hgp_view_fit *fit,
    struct hgp_view_camera *camera, struct hg_error *err) HG_MUST_CHECK;

// Statistics (HGP_T_stats_query with a view, 0 = none), sessions, info: a terminated JSON text,
// freed with helio_text_free.
HELIO_API enum hg_status helio_query_json(struct helio *h, enum hgp_type type, uint32_t view,
    char **text, struct hg_error *err) HG_MUST_CHECK;
HELIO_API void helio_text_free(char *text);

// ---- cameras (pure) ----------------------------------------------------------------------------

// Id of object `index` of the asset loaded as `asset` (0 = made by a client).
HELIO_API uint64_t helio_object_id(uint32_t asset, uint32_t index);

// Sets eye, target and up: eye = target + radius (sin phi sin theta, cos phi, sin phi cos theta),
// degrees, +Y up. Radius 0 stands at `target` and looks the way a larger radius would. Straight
// above and below, `up` is the limit of the neighbouring views.
HELIO_API void helio_camera_orbit(double theta_deg, double phi_deg, double radius,
    const double target[3], struct hgp_view_camera *camera);

// The angles of a named view, degrees: front, back, left, right, top, bottom, iso. False: no such
// view. For azimuth_rad and elevation_rad of view_fit.
HELIO_API bool helio_view_angles(const char *name, double *azimuth_deg, double *elevation_deg);

#ifdef __cplusplus
}
#endif
#endif
