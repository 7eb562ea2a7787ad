//! Time that processors have worked, which other programs on the machine do not lengthen as they do wall time.

use std::time::Duration;

/// User and system time of all threads of the process so far; none where the system does not tell.
pub fn of_process() -> Option<Duration> {
    #[cfg(unix)]
    return read(rustix::time::ClockId::ProcessCPUTime);
    #[cfg(not(unix))]
    None
}

/// User and system time of the calling thread so far; none where the system does not tell.
pub fn of_thread() -> Option<Duration> {
    #[cfg(unix)]
    return read(rustix::time::ClockId::ThreadCPUTime);
    #[cfg(not(unix))]
    None
}

#[cfg(unix)]
fn read(clock: rustix::time::ClockId) -> Option<Duration> {
    Duration::try_from(rustix::time::clock_gettime(clock)).ok()
}
