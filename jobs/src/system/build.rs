//! Which program this is: version and instruction set. Restarts are bit-identical on the same instruction set only.

/// Version and commit of this build.
#[must_use]
pub fn name() -> String {
    match option_env!("MENISCUS_COMMIT") {
        Some(commit) if !commit.is_empty() => format!("{}+{commit}", env!("CARGO_PKG_VERSION")),
        _ => env!("CARGO_PKG_VERSION").to_owned(),
    }
}

/// The instruction-set level that the numerics were compiled for.
#[must_use]
pub fn isa() -> String {
    let features: [(&str, bool); 4] = [
        ("avx512f", cfg!(target_feature = "avx512f")),
        ("avx2", cfg!(target_feature = "avx2")),
        ("fma", cfg!(target_feature = "fma")),
        ("neon", cfg!(target_feature = "neon")),
    ];
    let mut name = std::env::consts::ARCH.to_owned();
    for (feature, present) in features {
        if present {
            name.push('+');
            name.push_str(feature);
        }
    }
    name
}
