// SIGINT, SIGTERM and SIGHUP as a flag that long loops poll.
#pragma once

namespace octrad {

// From now on SIGINT, SIGTERM and SIGHUP print a message and end the process at once with exit code 130: there is
// nothing to save yet. A SIGHUP that is ignored (nohup) stays ignored.
void install_interrupt_handler();

// Call when there begins to be something to save (again does no harm): from now on the first signal only sets a flag,
// and the second one ends the process at once; but SIGHUP, of which a closed terminal sends several, never does.
void defer_interrupts();

// Whether a signal has arrived. Cheap and thread-safe.
bool interrupted();

}  // namespace octrad
