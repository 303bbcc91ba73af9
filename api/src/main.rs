//! The one binary, `meniscus`.

use std::process::ExitCode;

fn main() -> ExitCode {
    meniscus_api::cli::main()
}
