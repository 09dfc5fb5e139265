// list.h - doubly linked lists of structs with `prev` and `next`, whose head is `head`.
#ifndef HG_BROKER_LIST_H
#define HG_BROKER_LIST_H

#define HG_LIST_ADD(head, item)                                                                    \
    do {                                                                                           \
        (item)->prev = NULL;                                                                       \
        (item)->next = (head);                                                                     \
        if (head)                                                                                  \
            (head)->prev = (item);                                                                 \
        (head) = (item);                                                                           \
    } while (0)
#define HG_LIST_REMOVE(head, item)                                                                 \
    do {                                                                                           \
        if ((item)->prev)                                                                          \
            (item)->prev->next = (item)->next;                                                     \
        else                                                                                       \
            (head) = (item)->next;                                                                 \
        if ((item)->next)                                                                          \
            (item)->next->prev = (item)->prev;                                                     \
        (item)->prev = (item)->next = NULL;                                                        \
    } while (0)

#endif
