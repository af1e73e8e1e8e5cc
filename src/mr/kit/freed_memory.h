#pragma once

namespace mr::kit {

/// Lets this process keep up to 64 MB of what it frees, and makes blocks of less than 32 MB of such
/// memory: for programs whose pictures come and go with every capture. Otherwise each picture is
/// new pages, which the system fills with zeros first: a tenth of the time of reading a recording.
/// For the start of main(). Where the system's allocator is another than glibc's, nothing happens.
void keep_freed_memory();

}  // namespace mr::kit
