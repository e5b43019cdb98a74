// SIGINT and SIGTERM as a flag that long loops poll.
#pragma once

namespace octrad {

// From now on SIGINT and SIGTERM print a message and end the process at once with exit code 130: there is nothing to
// save yet.
void install_interrupt_handler();

// Call when there begins to be something to save (again does no harm): from now on the first signal only sets a flag,
// and the second one ends the process at once.
void defer_interrupts();

// Whether a signal has arrived. Cheap and thread-safe.
bool interrupted();

}  // namespace octrad
