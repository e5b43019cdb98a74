// SIGINT and SIGTERM as a flag that long loops look at.
#pragma once

namespace octrad {

// The first SIGINT or SIGTERM only sets a flag; the second one ends the process at once with exit code 130.
void install_interrupt_handler();

// Whether a signal has arrived. Cheap and thread-safe.
bool interrupted();
// The signal's number, 0 if none came.
int interrupt_signal();
// For tests: as if a signal had arrived (or none).
void set_interrupted(int signal);

}  // namespace octrad
