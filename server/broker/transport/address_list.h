// address_list.h - lists of addresses and networks in options: 10.0.0.1, 10.0.0.0/8, fd00::/8,
// loopback. Floor 6 (broker). Pure functions.
#ifndef HG_BROKER_ADDRESS_LIST_H
#define HG_BROKER_ADDRESS_LIST_H

#include "server/broker/options.h"

// HG_E_INVAL: err names the element that is no address; `option` is the option's name.
enum hg_status hg_address_list_check(
    const struct hg_text_list *list, const char *option, struct hg_error *err) HG_MUST_CHECK;
// Is a numeric address in one of the list's networks? IPv4 within IPv6 counts as IPv4.
bool hg_address_list_has(const struct hg_text_list *list, const char *address);

#endif
