//! A memory limit by the kernel, where control groups (version 2) can be written. Elsewhere the service's own watch on
//! resident size is the only limit.

use std::fs;
use std::path::{Path, PathBuf};

/// A control group of one worker; removed when dropped.
#[derive(Debug)]
pub struct MemoryGroup {
    path: PathBuf,
}

impl MemoryGroup {
    /// Makes a group below `root` with a hard limit and puts a process into it; None where that is not possible.
    #[must_use]
    pub fn enclose(root: &Path, name: &str, pid: u32, memory_bytes: u64) -> Option<Self> {
        let controllers = fs::read_to_string(root.join("cgroup.controllers")).ok()?;
        if !controllers.split_whitespace().any(|word| word == "memory") {
            return None;
        }
        let group = Self { path: root.join(format!("meniscus-{name}")) };
        fs::create_dir(&group.path).ok()?;
        // A group that cannot be used is removed again by its drop.
        fs::write(group.path.join("memory.max"), memory_bytes.to_string()).ok()?;
        fs::write(group.path.join("cgroup.procs"), pid.to_string()).ok()?;
        Some(group)
    }

    /// Whether the kernel ended a process of this group for lack of memory.
    #[must_use]
    pub fn has_killed(&self) -> bool {
        let events = fs::read_to_string(self.path.join("memory.events")).unwrap_or_default();
        events.lines().any(|line| line.strip_prefix("oom_kill ").is_some_and(|count| count.trim() != "0"))
    }
}

impl Drop for MemoryGroup {
    fn drop(&mut self) {
        // The kernel refuses while a process is left; the next start of the machine clears it.
        let _ = fs::remove_dir(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::MemoryGroup;

    #[test]
    fn writes_what_the_kernel_reads_and_reads_what_it_writes() {
        // A plain directory stands in for the kernel's, which this machine may not have.
        let root = tempfile::tempdir().unwrap();
        assert!(MemoryGroup::enclose(root.path(), "a", 42, 1000).is_none());
        std::fs::write(root.path().join("cgroup.controllers"), "cpu memory pids").unwrap();
        let group = MemoryGroup::enclose(root.path(), "a", 42, 1000).unwrap();
        let folder = root.path().join("meniscus-a");
        assert_eq!(std::fs::read_to_string(folder.join("memory.max")).unwrap(), "1000");
        assert_eq!(std::fs::read_to_string(folder.join("cgroup.procs")).unwrap(), "42");
        assert!(!group.has_killed());
        std::fs::write(folder.join("memory.events"), "low 0\noom 1\noom_kill 1\n").unwrap();
        assert!(group.has_killed());
    }
}
