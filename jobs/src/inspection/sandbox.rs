//! The limits of a process that looks into files from outside: memory, time, no writing, and after [`shut_the_door`] one
//! file and no other (which leaves no socket either). On top of it a filter of system calls, where the kernel has it.

use rustix::process::{Resource, Rlimit, setrlimit};
use std::fs::File;
use std::io;
use std::os::fd::AsRawFd;

/// Most address space of the process, in bytes.
const MEMORY_BYTES: u64 = 4 << 30;
/// Most CPU time of the process, in seconds.
const SECONDS: u64 = 60;

fn limit(resource: Resource, value: u64) -> io::Result<()> {
    Ok(setrlimit(resource, Rlimit { current: Some(value), maximum: Some(value) })?)
}

/// Takes away what no file needs: more memory and time than is granted, writing to files, dumps, new processes and
/// sockets.
///
/// # Errors
/// When a limit cannot be set: then nothing must be opened.
pub fn enter() -> io::Result<()> {
    limit(Resource::As, MEMORY_BYTES)?;
    limit(Resource::Cpu, SECONDS)?;
    limit(Resource::Fsize, 0)?;
    limit(Resource::Core, 0)?;
    filter::apply()
}

/// From here on one more file can be open beside `file` (libhdf5 opens it anew), and nothing else: no other file, no
/// plug-in, no socket.
///
/// # Errors
/// When the limit cannot be set.
pub fn shut_the_door(file: &File) -> io::Result<()> {
    let most = u64::try_from(file.as_raw_fd()).unwrap_or(0) + 2;
    limit(Resource::Nofile, most)
}

#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
mod filter {
    use seccompiler::{BpfProgram, SeccompAction, SeccompFilter, TargetArch};
    use std::collections::BTreeMap;
    use std::io;

    /// The same numbers on both processors are looked up by name.
    const REFUSED: &[i64] = &[
        libc::SYS_socket,
        libc::SYS_socketpair,
        libc::SYS_connect,
        libc::SYS_bind,
        libc::SYS_listen,
        libc::SYS_accept,
        libc::SYS_accept4,
        libc::SYS_sendto,
        libc::SYS_sendmsg,
        libc::SYS_execve,
        libc::SYS_execveat,
        libc::SYS_ptrace,
        libc::SYS_process_vm_writev,
        libc::SYS_mount,
        libc::SYS_unshare,
        libc::SYS_setns,
        libc::SYS_bpf,
        libc::SYS_keyctl,
        libc::SYS_io_uring_setup,
        libc::SYS_unlinkat,
        libc::SYS_renameat2,
        libc::SYS_linkat,
        libc::SYS_symlinkat,
        libc::SYS_mkdirat,
        libc::SYS_fchmodat,
        libc::SYS_kill,
        libc::SYS_tkill,
        libc::SYS_tgkill,
        libc::SYS_rt_sigqueueinfo,
        libc::SYS_pidfd_send_signal,
        libc::SYS_clone,
        libc::SYS_clone3,
        libc::SYS_truncate,
        libc::SYS_ftruncate,
        libc::SYS_process_vm_readv,
        libc::SYS_openat2,
    ];

    /// Older calls, which newer processors do not have.
    #[cfg(target_arch = "x86_64")]
    const OLD: &[i64] = &[
        libc::SYS_fork,
        libc::SYS_vfork,
        libc::SYS_unlink,
        libc::SYS_rmdir,
        libc::SYS_rename,
        libc::SYS_renameat,
        libc::SYS_link,
        libc::SYS_symlink,
        libc::SYS_mkdir,
        libc::SYS_chmod,
        libc::SYS_chown,
        libc::SYS_creat,
    ];
    #[cfg(not(target_arch = "x86_64"))]
    const OLD: &[i64] = &[];

    /// Refused calls fail with "not permitted"; everything else goes on.
    pub fn apply() -> io::Result<()> {
        let arch = if cfg!(target_arch = "x86_64") { TargetArch::x86_64 } else { TargetArch::aarch64 };
        let rules: BTreeMap<i64, Vec<_>> = REFUSED.iter().chain(OLD).map(|call| (*call, Vec::new())).collect();
        let refuse = SeccompAction::Errno(libc::EPERM as u32);
        let program: BpfProgram = SeccompFilter::new(rules, SeccompAction::Allow, refuse, arch)
            .and_then(TryInto::try_into)
            .map_err(io::Error::other)?;
        match seccompiler::apply_filter(&program) {
            Ok(()) => Ok(()),
            // A kernel without filters leaves the limits above, which shut out files and sockets by themselves.
            Err(error) => {
                tracing::debug!(%error, "no filter of system calls");
                Ok(())
            }
        }
    }
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
mod filter {
    /// No filter on this processor: the limits above shut out files and sockets by themselves.
    pub fn apply() -> std::io::Result<()> {
        Ok(())
    }
}
