// Two hosts in one: network namespaces A and B, each with a veth to a switch (a bridge in a third
// namespace), and the DDS configurations that daemon and client use there. The calling process
// moves into A; what it spawns is in A too, or in B through hosts_spawn. A guardian, a process of
// its own, removes everything when the calling process ends, however it ends.
#ifndef PB_TESTS_E2E_HOSTS_H
#define PB_TESTS_E2E_HOSTS_H

#include "harness.h"

typedef enum hosts_discovery {
  HOSTS_MULTICAST,  // config/dds-lan.xml on the interface
  HOSTS_PEERS,      // the same without multicast: both hosts are listed
  HOSTS_LOSSY,      // multicast; each side does not send one packet of a hundred
  HOSTS_MUTE,       // multicast; nothing is sent at all
} hosts_discovery;

// Makes both hosts. False: this process may not, or a tool is missing; why (256 octets) says it.
bool hosts_make(char *why);

// Removes both hosts and the files; true when nothing is left.
bool hosts_remove(void);

// Writes the configuration and points CYCLONEDDS_URI of this process to it. The file's name, which
// lives until the next call.
const char *hosts_configure(hosts_discovery discovery);

// A program (argv[0] is the file, at most 12 arguments) on host B.
e2e_child hosts_spawn(const char *const argv[]);

// The cable between the switch and host B: out, or in again.
void hosts_link(bool up);

// Delay and loss on both ways by the kernel's netem; false: this kernel has none.
bool hosts_disturb(const char *delay, const char *loss);
void hosts_calm(void);

#endif
