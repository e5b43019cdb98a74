// Large pages for what a process has in memory.
#pragma once

namespace octrad {

// Asks the system to move the heap, as it is now, to pages of 2 MiB: look-ups all over a scene's triangles, texels and
// tables then find more of their addresses in the processor's cache for them. Without such pages nothing changes.
// Memory between what is allocated may become resident with it.
void use_huge_pages();

}  // namespace octrad
