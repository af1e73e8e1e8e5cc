#pragma once

namespace mr::kit {

/// Lets each heap of this process (glibc has some for each core) keep up to 64 MB of free memory at
/// its end, and takes blocks of up to 32 MB from heaps: for programs whose pictures come and go
/// with every capture. Otherwise each picture is new pages, which the system fills with zeros
/// first: a tenth of the time of reading a recording. For the start of main(). With another
/// allocator than glibc's nothing happens.
void keep_freed_memory();

}  // namespace mr::kit
