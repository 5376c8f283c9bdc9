//! Memory layout of the board that QEMU emulates for each target.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-env-changed=FIRMWARE_DATA");
    println!("cargo:rustc-check-cfg=cfg(small)");
    // Where `tests/firmware.rs` writes what the images hold.
    let data = env::var("FIRMWARE_DATA").unwrap_or_else(|_| {
        let here = env::var("CARGO_MANIFEST_DIR").expect("cargo tells");
        format!("{here}/../../target/firmware/data")
    });
    println!("cargo:rustc-env=FIRMWARE_DATA={data}");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let target = env::var("TARGET").expect("cargo tells");
    let is_small = target.starts_with("thumbv6m");
    if is_small {
        println!("cargo:rustc-cfg=small");
    }
    // The screen of the panel, which real boards keep in memory of its own, takes 150 KB.
    let has_screen = env::var_os("CARGO_FEATURE_PANEL").is_some();
    let (flash, ram) = match (is_small, has_screen) {
        (true, _) => ("256K", "16K"),
        (false, false) => ("4M", "192K"),
        (false, true) => ("4M", "4M"),
    };
    let memory = format!(
        "MEMORY {{\n  FLASH : ORIGIN = 0x00000000, LENGTH = {flash}\n  RAM : ORIGIN = 0x20000000, LENGTH = {ram}\n}}\n"
    );
    let out = PathBuf::from(env::var("OUT_DIR").expect("cargo tells"));
    fs::write(out.join("memory.x"), memory).expect("cargo's own folder");
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rustc-link-arg=-Tlink.x");
    println!("cargo:rustc-link-arg=--nmagic");
}
