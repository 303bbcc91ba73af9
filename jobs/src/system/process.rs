//! Facts of the operating system: CPU time, memory, free space.

use rustix::process::{getpriority_process, setpriority_process};
use rustix::time::{ClockId, clock_gettime};
use std::path::Path;
use std::sync::OnceLock;

/// CPU seconds of this process, all threads.
#[must_use]
pub fn cpu_seconds() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// Lowers the priority of this process.
pub fn be_nice() {
    if getpriority_process(None).is_ok_and(|priority| priority < 10) {
        // A process that cannot lower its priority works all the same.
        let _ = setpriority_process(None, 10);
    }
}

/// Ends this process without exit handlers, which could wait for a library that another thread is inside of. A file in the
/// making has an unfinished name.
pub fn end_at_once() {
    let _ = rustix::process::kill_process(rustix::process::getpid(), rustix::process::Signal::KILL);
}

/// Name of this machine; that of the node where a cluster started this process.
#[must_use]
pub fn host_name() -> String {
    let node = std::env::var("SLURMD_NODENAME").ok();
    let read = || std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default().trim().to_owned();
    node.unwrap_or_else(read)
}

/// A line `Name:  1234 kB` of `/proc/PID/status` in bytes.
fn status_bytes(pid: u32, name: &str) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'))?;
    line.split_whitespace().next()?.parse::<u64>().ok().map(|kilobytes| kilobytes * 1024)
}

/// Resident memory of a process now.
#[must_use]
pub fn resident_bytes(pid: u32) -> Option<u64> {
    status_bytes(pid, "VmRSS")
}

/// Most resident memory of a process so far.
#[must_use]
pub fn peak_resident_bytes(pid: u32) -> Option<u64> {
    status_bytes(pid, "VmHWM")
}

/// Memory that new processes can have.
#[must_use]
pub fn available_memory() -> Option<u64> {
    meminfo("MemAvailable")
}

/// Memory of the machine.
#[must_use]
pub fn total_memory() -> Option<u64> {
    static TOTAL: OnceLock<Option<u64>> = OnceLock::new();
    *TOTAL.get_or_init(|| meminfo("MemTotal"))
}

fn meminfo(name: &str) -> Option<u64> {
    let info = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = info.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'))?;
    line.split_whitespace().next()?.parse::<u64>().ok().map(|kilobytes| kilobytes * 1024)
}

/// Bytes that an ordinary user can still write where `path` lives.
#[must_use]
pub fn free_space(path: &Path) -> Option<u64> {
    let stat = rustix::fs::statvfs(path).ok()?;
    Some(stat.f_bavail * stat.f_frsize)
}

/// Bytes of all files below a directory.
#[must_use]
pub fn directory_bytes(directory: &Path) -> u64 {
    let Ok(entries) = std::fs::read_dir(directory) else {
        return 0;
    };
    entries
        .flatten()
        .map(|entry| match entry.metadata() {
            Ok(meta) if meta.is_dir() => directory_bytes(&entry.path()),
            Ok(meta) => meta.len(),
            Err(_) => 0,
        })
        .sum()
}

/// Whether an error says that the device is full.
#[must_use]
pub fn is_out_of_space(error: &(dyn std::error::Error + 'static)) -> bool {
    let mut current = Some(error);
    while let Some(error) = current {
        let full = error
            .downcast_ref::<std::io::Error>()
            .is_some_and(|e| matches!(e.kind(), std::io::ErrorKind::StorageFull | std::io::ErrorKind::QuotaExceeded));
        // libhdf5 wraps the system's error in text.
        if full
            || error.to_string().contains("No space left on device")
            || error.to_string().contains("database or disk is full")
        {
            return true;
        }
        current = error.source();
    }
    false
}

/// The name of this machine's processor.
#[must_use]
pub fn cpu_name() -> Option<String> {
    let info = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = info.lines().find(|line| line.starts_with("model name"))?;
    line.split(':').nth(1).map(|name| name.trim().to_owned())
}

/// Whether an error says that the system has no descriptors, threads, processes or memory left, which may pass.
#[must_use]
pub fn is_shortage(error: &(dyn std::error::Error + 'static)) -> bool {
    const SHORTAGES: [i32; 4] = [libc::EAGAIN, libc::EMFILE, libc::ENFILE, libc::ENOMEM];
    let mut current = Some(error);
    while let Some(error) = current {
        let code = error.downcast_ref::<std::io::Error>().and_then(std::io::Error::raw_os_error);
        if code.is_some_and(|code| SHORTAGES.contains(&code)) {
            return true;
        }
        current = error.source();
    }
    false
}
