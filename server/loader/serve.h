// serve.h - a loader's life: requests of the worker, one after the other, until it closes the link.
// Floor 6, private to server/loader.
#ifndef HG_SERVER_LOADER_SERVE_H
#define HG_SERVER_LOADER_SERVE_H

// Does not return. Exit codes: wire.h.
_Noreturn void hg_loader_serve(int fd);

#endif
