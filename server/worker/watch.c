#include "server/worker/watch.h"

#include "base/clock.h"

void hg_watch_init(struct watch_list *list)
{
    pthread_mutex_init(&list->lock, NULL);
    list->first = NULL;
}

void hg_watch_finish(struct watch_list *list)
{
    pthread_mutex_destroy(&list->lock);
}

void hg_watch_add(struct watch_list *list, struct watch *watch)
{
    hg_watch_end(watch);
    watch->prev = NULL;
    pthread_mutex_lock(&list->lock);
    watch->next = list->first;
    if (list->first)
        list->first->prev = watch;
    list->first = watch;
    pthread_mutex_unlock(&list->lock);
}

void hg_watch_remove(struct watch_list *list, struct watch *watch)
{
    pthread_mutex_lock(&list->lock);
    *(watch->prev ? &watch->prev->next : &list->first) = watch->next;
    if (watch->next)
        watch->next->prev = watch->prev;
    pthread_mutex_unlock(&list->lock);
}

void hg_watch_begin(struct watch *watch, struct watch_work work)
{
    atomic_store(&watch->channel, work.channel);
    atomic_store(&watch->request, work.request);
    atomic_store(&watch->view, work.view);
    atomic_store(&watch->since_ns, hg_clock_now_ns());
}

void hg_watch_go_on(struct watch *watch)
{
    atomic_store(&watch->since_ns, hg_clock_now_ns());
}

void hg_watch_end(struct watch *watch)
{
    atomic_store(&watch->since_ns, 0);
}

uint64_t hg_watch_longest_ns(struct watch_list *list, struct watch_work *work)
{
    const uint64_t now_ns = hg_clock_now_ns();
    uint64_t longest_ns = 0;
    *work = (struct watch_work){0};
    pthread_mutex_lock(&list->lock);
    for (struct watch *it = list->first; it; it = it->next) {
        const uint64_t since_ns = atomic_load(&it->since_ns);
        if (!since_ns || now_ns <= since_ns || now_ns - since_ns <= longest_ns)
            continue;
        longest_ns = now_ns - since_ns;
        *work = (struct watch_work){
            atomic_load(&it->channel), atomic_load(&it->request), atomic_load(&it->view)};
    }
    pthread_mutex_unlock(&list->lock);
    return longest_ns;
}
