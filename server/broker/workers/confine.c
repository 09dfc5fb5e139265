#include "server/broker/workers/confine.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <linux/capability.h>
#include <linux/mount.h>
#include <linux/securebits.h>
#include <sched.h>
#include <stdio.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

// sys/mount.h and linux/mount.h cannot be included together in older C libraries.
int mount(const char *source, const char *target, const char *type, unsigned long flags,
    const void *data);
int umount2(const char *target, int flags);
enum { DETACH = 2 }; // MNT_DETACH

static const char new_root[] = "/tmp", old_root[] = "/.old";

int hg_confine_clone_flags(enum hg_confine_level level)
{
    const int files = CLONE_NEWUSER | CLONE_NEWNS | CLONE_NEWNET | CLONE_NEWIPC | CLONE_NEWUTS;
    return level == HG_CONFINE_NONE ? 0 : level == HG_CONFINE_FILES ? files : files | CLONE_NEWPID;
}

// ---- users --------------------------------------------------------------------------------------

static int write_text(const char *path, const char *text)
{
    const int fd = open(path, O_WRONLY | O_CLOEXEC);
    const ssize_t size = (ssize_t)strlen(text);
    const int failed = fd < 0 || write(fd, text, (size_t)size) != size ? errno : 0;
    if (fd >= 0)
        close(fd);
    return failed;
}

// The same numbers inside: one user, one group (user_namespaces(7)).
static int map_ids(uid_t uid, gid_t gid)
{
    char text[64];
    int failed = write_text("/proc/self/setgroups", "deny");
    snprintf(text, sizeof text, "%u %u 1", (unsigned)uid, (unsigned)uid);
    if (!failed)
        failed = write_text("/proc/self/uid_map", text);
    snprintf(text, sizeof text, "%u %u 1", (unsigned)gid, (unsigned)gid);
    return failed ? failed : write_text("/proc/self/gid_map", text);
}

int hg_confine_drop_capabilities(void)
{
    struct __user_cap_header_struct header = {.version = _LINUX_CAPABILITY_VERSION_3};
    struct __user_cap_data_struct none[2] = {{0}, {0}};
    for (int cap = 0; cap < 64; cap++) // those that are not known, or not held, fail
        prctl(PR_CAPBSET_DROP, cap, 0, 0, 0);
    // Root is a user like others from here on; without the right to say so it was one already.
    prctl(PR_SET_SECUREBITS,
        SECBIT_NOROOT | SECBIT_NOROOT_LOCKED | SECBIT_NO_SETUID_FIXUP |
            SECBIT_NO_SETUID_FIXUP_LOCKED | SECBIT_KEEP_CAPS_LOCKED,
        0, 0, 0);
    prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_CLEAR_ALL, 0, 0, 0);
    if (syscall(SYS_capset, &header, none) != 0)
        return errno;
    return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 ? 0 : errno;
}

// ---- files --------------------------------------------------------------------------------------

// Folders above a path, and the path itself: a folder, or an empty file to be covered.
static int make_point(const char *path, bool is_folder)
{
    char part[PATH_MAX];
    if ((size_t)snprintf(part, sizeof part, "%s", path) >= sizeof part)
        return ENAMETOOLONG;
    for (char *slash = strchr(part + 1, '/'); slash; slash = strchr(slash + 1, '/')) {
        *slash = 0;
        if (mkdir(part, 0755) != 0 && errno != EEXIST)
            return errno;
        *slash = '/';
    }
    if (is_folder)
        return mkdir(part, 0755) == 0 || errno == EEXIST ? 0 : errno;
    const int fd = open(part, O_WRONLY | O_CREAT | O_CLOEXEC, 0644);
    if (fd >= 0)
        close(fd);
    return fd >= 0 || errno == EEXIST || errno == EROFS ? 0 : errno;
}

static int restrict_mount(const char *path, enum hg_confine_access access)
{
    struct mount_attr attr = {.attr_set = MOUNT_ATTR_NOSUID};
    if (access != HG_CONFINE_DEVICE)
        attr.attr_set |= MOUNT_ATTR_NODEV;
    if (access == HG_CONFINE_READ)
        attr.attr_set |= MOUNT_ATTR_RDONLY;
    return syscall(SYS_mount_setattr, AT_FDCWD, path, 0x8000 /* AT_RECURSIVE */, &attr,
               sizeof attr) == 0
               ? 0
               : errno;
}

static int show(const struct hg_confine_path *path)
{
    char from[PATH_MAX];
    struct stat st;
    if ((size_t)snprintf(from, sizeof from, "%s%s", old_root, path->path) >= sizeof from)
        return ENAMETOOLONG;
    if (stat(from, &st) != 0)
        return 0;
    int failed = make_point(path->path, S_ISDIR(st.st_mode));
    if (!failed && mount(from, path->path, NULL, MS_BIND | MS_REC, NULL) != 0)
        failed = errno;
    return failed ? failed : restrict_mount(path->path, path->access);
}

// What every worker needs, before its own paths.
static const struct hg_confine_path common[] = {
    {"/usr", HG_CONFINE_READ},
    {"/lib", HG_CONFINE_READ},
    {"/lib64", HG_CONFINE_READ},
    {"/opt", HG_CONFINE_READ},
    {"/sys", HG_CONFINE_READ},
    {"/run/nvidia-persistenced", HG_CONFINE_READ},
    {"/etc/ld.so.cache", HG_CONFINE_READ},
    {"/etc/ld.so.preload", HG_CONFINE_READ},
    {"/etc/alternatives", HG_CONFINE_READ},
    {"/etc/vulkan", HG_CONFINE_READ},
    {"/etc/glvnd", HG_CONFINE_READ},
    {"/etc/xdg", HG_CONFINE_READ},
    {"/etc/drirc", HG_CONFINE_READ},
    {"/etc/nvidia", HG_CONFINE_READ},
    {"/etc/localtime", HG_CONFINE_READ},
    {"/dev/null", HG_CONFINE_DEVICE},
    {"/dev/zero", HG_CONFINE_DEVICE},
    {"/dev/full", HG_CONFINE_DEVICE},
    {"/dev/urandom", HG_CONFINE_DEVICE},
    {"/dev/random", HG_CONFINE_DEVICE},
    {"/dev/dri", HG_CONFINE_DEVICE},
    {"/dev/kfd", HG_CONFINE_DEVICE},
    {"/dev/nvidia0", HG_CONFINE_DEVICE},
    {"/dev/nvidiactl", HG_CONFINE_DEVICE},
    {"/dev/nvidia-modeset", HG_CONFINE_DEVICE},
    {"/dev/nvidia-uvm", HG_CONFINE_DEVICE},
    {"/dev/nvidia-uvm-tools", HG_CONFINE_DEVICE},
};

static int mount_fresh(const char *type, const char *path, const char *data)
{
    const int failed = make_point(path, true);
    if (failed)
        return failed;
    return mount(type, path, type, MS_NOSUID | MS_NODEV | MS_NOEXEC, data) == 0 ? 0 : errno;
}

// An empty root takes the place of the old one, which is seen below it until all is shown.
static int turn_root(void)
{
    if (mount(NULL, "/", NULL, MS_REC | MS_SLAVE, NULL) != 0 ||
        mount("tmpfs", new_root, "tmpfs", MS_NOSUID | MS_NODEV, "size=1m,mode=755") != 0 ||
        chdir(new_root) != 0 || mkdir(&old_root[1], 0700) != 0 ||
        syscall(SYS_pivot_root, ".", &old_root[1]) != 0 || chdir("/") != 0)
        return errno;
    return 0;
}

static int enter_files(enum hg_confine_level level, const struct hg_confine_path *paths,
    size_t count, const char **step)
{
    *step = "turn the root";
    int failed = turn_root();
    for (size_t i = 0; !failed && i < sizeof common / sizeof *common; i++) {
        *step = common[i].path;
        failed = show(&common[i]);
    }
    if (!failed) {
        *step = "/proc";
        failed = level == HG_CONFINE_ALL
                     ? mount_fresh("proc", "/proc", NULL)
                     : show(&(struct hg_confine_path){"/proc", HG_CONFINE_READ});
    }
    if (!failed) {
        *step = "/tmp";
        failed = mount_fresh("tmpfs", "/tmp", "size=64m,mode=1777");
    }
    if (!failed)
        failed = mount_fresh("tmpfs", "/dev/shm", "size=64m,mode=1777");
    for (size_t i = 0; !failed && i < count; i++) {
        *step = paths[i].path;
        failed = show(&paths[i]);
    }
    if (failed)
        return failed;
    *step = "leave the old root";
    struct mount_attr attr = {.attr_set = MOUNT_ATTR_RDONLY};
    if (umount2(old_root, DETACH) != 0 || rmdir(old_root) != 0 ||
        syscall(SYS_mount_setattr, AT_FDCWD, "/", 0, &attr, sizeof attr) != 0)
        return errno;
    return 0;
}

int hg_confine_enter(enum hg_confine_level level, const struct hg_confine_path *paths, size_t count,
    uid_t uid, gid_t gid, const char **step)
{
    int failed = 0;
    *step = "map users";
    if (level != HG_CONFINE_NONE)
        failed = map_ids(uid, gid);
    if (!failed && level != HG_CONFINE_NONE)
        failed = enter_files(level, paths, count, step);
    if (failed)
        return failed;
    *step = "drop capabilities";
    return hg_confine_drop_capabilities();
}
