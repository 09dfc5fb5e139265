#include "server/loader/serve.h"

#include <errno.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include "renderer/image/input.h"
#include "renderer/scene/formats/formats.h"
#include "server/loader/wire.h"

static hg_isolate_serve_fn *const servers[HG_ISOLATE_OPS] = {
    [HG_ISOLATE_IMPORT] = hg_import_serve,
    [HG_ISOLATE_DRACO] = hg_draco_serve,
    [HG_ISOLATE_DRACO_VALUES] = hg_draco_serve,
    [HG_ISOLATE_IMAGE_OPEN] = hg_input_serve,
    [HG_ISOLATE_IMAGE_PART] = hg_input_serve,
    [HG_ISOLATE_IMAGE_MIP] = hg_input_serve,
    [HG_ISOLATE_IMAGE_TEXT] = hg_input_serve,
    [HG_ISOLATE_IMAGE_READ] = hg_input_serve,
};

// ---- requests ----------------------------------------------------------------------------------

// False: the worker has closed the link.
static bool receive(int fd, struct loader_request *request, size_t *size, int fds[2])
{
    _Alignas(struct cmsghdr) char control[CMSG_SPACE(2 * sizeof(int))];
    struct iovec part = {request, sizeof *request};
    struct msghdr message = {.msg_iov = &part,
        .msg_iovlen = 1,
        .msg_control = control,
        .msg_controllen = sizeof control};
    ssize_t n;
    do {
        n = recvmsg(fd, &message, MSG_CMSG_CLOEXEC);
    } while (n < 0 && errno == EINTR);
    if (n <= 0)
        return false;
    const struct cmsghdr *head = CMSG_FIRSTHDR(&message);
    const int count = request->has_data || request->has_file ? 2 : 1;
    if (!head || head->cmsg_len != CMSG_LEN((size_t)count * sizeof(int)))
        _exit(LOADER_EXIT_PROTOCOL);
    memcpy(fds, CMSG_DATA(head), (size_t)count * sizeof(int));
    if (count == 1) {
        fds[1] = fds[0];
        fds[0] = -1;
    }
    *size = (size_t)n;
    return true;
}

// Data stays until the next comes: an image is read by several requests.
static void take_data(const struct loader_request *from, int fd, struct hg_isolate_request *to)
{
    if (from->has_data && to->data) {
        munmap((void *)to->data, to->data_size);
        to->data = NULL;
        to->data_size = 0;
    }
    if (from->has_data && from->data_size) {
        void *data = mmap(NULL, (size_t)from->data_size, PROT_READ, MAP_PRIVATE, fd, 0);
        if (data == MAP_FAILED)
            _exit(LOADER_EXIT_MEMORY);
        to->data = data;
        to->data_size = (size_t)from->data_size;
    }
    if (from->has_data)
        close(fd);
    if (from->has_file)
        to->file = fd;
}

static bool write_result(int fd, const struct hg_writer *result)
{
    for (size_t done = 0; done < result->size;) {
        const ssize_t n = write(fd, result->data + done, result->size - done);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return false;
        done += (size_t)n;
    }
    return true;
}

static void answer(int fd, struct hg_isolate_request *request, int result_fd)
{
    struct loader_reply reply = {0};
    struct hg_writer result = {0};
    hg_isolate_serve_fn *serve =
        request->op < HG_ISOLATE_OPS && servers[request->op] ? servers[request->op] : NULL;
    if (!serve)
        _exit(LOADER_EXIT_PROTOCOL);
    enum hg_status status = serve(request, &result, &reply.err);
    if (status == HG_E_NOMEM || (!status && (result.failed || !write_result(result_fd, &result))))
        _exit(LOADER_EXIT_MEMORY);
    reply.status = status;
    reply.size = result.size;
    hg_writer_finish(&result);
    close(result_fd);
    if (send(fd, &reply, sizeof reply, MSG_NOSIGNAL) != sizeof reply)
        _exit(0);
}

// ---- memory ------------------------------------------------------------------------------------

static void out_of_memory(void)
{
    _exit(LOADER_EXIT_MEMORY);
}

// std::set_new_handler by its mangled name. The libraries are C++ and turn bad_alloc into a damaged
// file, or end by it; what ended is the memory.
extern void (*set_new_handler(void (*)(void)))(void) __asm__("_ZSt15set_new_handlerPFvvE");

_Noreturn void hg_loader_serve(int fd)
{
    static struct loader_request packet;
    struct hg_isolate_request request = {.file = -1};
    size_t size;
    int fds[2];
    (void)set_new_handler(out_of_memory);
    while (receive(fd, &packet, &size, fds)) {
        const size_t head = offsetof(struct loader_request, args);
        if (size < head || packet.args_size != size - head)
            _exit(LOADER_EXIT_PROTOCOL);
        packet.name[sizeof packet.name - 1] = 0;
        request.op = (enum hg_isolate_op)packet.op;
        request.args = hg_reader_make(packet.args, packet.args_size);
        request.name = packet.name;
        take_data(&packet, fds[0], &request);
        answer(fd, &request, fds[1]);
    }
    _exit(0);
}
