//! `cargo xtask supply`: licences and sources of the dependencies, and a bill of materials.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::Command;

use serde::Deserialize;
use serde_json::json;
use spdx::{Expression, LicenseReq, ParseMode};

use crate::run::{Result, root, run, say, target_folder};
use crate::tool::tool;

/// Workspaces, each with its own lock file.
const MANIFESTS: [&str; 5] = [
    "Cargo.toml",
    "firmware/boards/qemu-an505/Cargo.toml",
    "firmware/boards/rp2350-pico2/Cargo.toml",
    "firmware/boards/stm32f405/Cargo.toml",
    "fuzz/Cargo.toml",
];

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
}

#[derive(Deserialize, PartialEq, Eq, PartialOrd, Ord)]
struct Package {
    name: String,
    version: String,
    license: Option<String>,
    /// `None` for the crates of this project.
    source: Option<String>,
}

/// Rules for dependencies, which cargo-deny reads too.
#[derive(Deserialize)]
struct Rules {
    licenses: Licenses,
}

#[derive(Deserialize)]
struct Licenses {
    allow: BTreeSet<String>,
}

/// Checks, without any tool, that lock files are up to date, that licences are allowed by `deny.toml`, and that all
/// dependencies come from one registry; writes the bill of materials, `sbom.json` in the target folder, as CycloneDX, and
/// returns its path.
pub(crate) fn list_parts() -> Result<PathBuf> {
    let mut packages = BTreeSet::new();
    for manifest in MANIFESTS {
        packages.extend(metadata(manifest)?.packages);
    }
    let rules = std::fs::read_to_string(root().join("deny.toml"))
        .map_err(|error| format!("deny.toml: {error}"))?;
    let rules: Rules = toml::from_str(&rules).map_err(|error| format!("deny.toml: {error}"))?;
    let faults = faults(&packages, &rules.licenses.allow);
    if !faults.is_empty() {
        return Err(faults.join("\n"));
    }
    let file = target_folder()?.join("sbom.json");
    let text = serde_json::to_string_pretty(&bill_of_materials(&packages))
        .map_err(|error| format!("the list of parts: {error}"))?;
    std::fs::write(&file, text).map_err(|error| format!("{}: {error}", file.display()))?;
    say(&format!("{} parts: {}", packages.len(), file.display()));
    Ok(file)
}

/// What is wrong with licences and sources, by package.
fn faults(packages: &BTreeSet<Package>, allowed: &BTreeSet<String>) -> Vec<String> {
    let is_allowed = |license: &LicenseReq| allowed.contains(&license.to_string());
    let mut registries: Vec<&str> = Vec::new();
    let mut faults = Vec::new();
    for package in packages {
        let Package {
            name,
            version,
            license,
            source,
        } = package;
        // Crates of this project that are not published state no licence.
        let Some(source) = source else { continue };
        let parsed = license
            .as_deref()
            .and_then(|license| Expression::parse_mode(license, ParseMode::LAX).ok());
        if !parsed.is_some_and(|expression| expression.evaluate(is_allowed)) {
            let found = license.as_deref().unwrap_or("none");
            faults.push(format!(
                "{name} {version}: its licence is {found}, which deny.toml does not allow"
            ));
        }
        if !source.starts_with("registry+") {
            faults.push(format!(
                "{name} {version}: it comes from {source}, not from a registry"
            ));
        } else if !registries.contains(&source.as_str()) {
            registries.push(source);
        }
    }
    if registries.len() > 1 {
        faults.push(format!(
            "dependencies come from several registries: {}",
            registries.join(", ")
        ));
    }
    faults
}

/// Same as [`list_parts`], and checks with cargo-deny. With `advisories`, known vulnerabilities are checked too, which needs a network.
pub(crate) fn supply(advisories: bool) -> Result<()> {
    list_parts()?;
    let program = tool("cargo-deny", "0.20.2", &[], &[])?
        .display()
        .to_string();
    let mut checks = vec!["bans", "licenses", "sources"];
    if advisories {
        checks.push("advisories");
    }
    for manifest in MANIFESTS {
        let mut arguments = vec![
            "--manifest-path",
            manifest,
            "--locked",
            "check",
            "--hide-inclusion-graph",
        ];
        arguments.extend(&checks);
        run(&program, &arguments)?;
    }
    Ok(())
}

/// Cargo's metadata of a workspace; fails if its lock file is not up to date.
fn metadata(manifest: &str) -> Result<Metadata> {
    let output = Command::new("cargo")
        .args([
            "metadata",
            "--locked",
            "--format-version=1",
            "--manifest-path",
            manifest,
        ])
        .current_dir(root())
        .output()
        .map_err(|error| format!("cannot start cargo: {error}"))?;
    if !output.status.success() {
        let errors = String::from_utf8_lossy(&output.stderr);
        return Err(format!("{manifest}: {errors}"));
    }
    serde_json::from_slice(&output.stdout)
        .map_err(|error| format!("{manifest}: cargo metadata: {error}"))
}

/// A bill of materials in CycloneDX 1.5: every crate with name, version, licence and source.
fn bill_of_materials(packages: &BTreeSet<Package>) -> serde_json::Value {
    let components: Vec<_> = packages
        .iter()
        .map(|package| {
            let Package { name, version, .. } = package;
            let mut component = json!({
                "type": "library",
                "bom-ref": format!("{name}@{version}"),
                "name": name,
                "version": version,
            });
            if let Some(license) = &package.license {
                component["licenses"] =
                    json!([{ "expression": license.replace(" / ", "/").replace('/', " OR ") }]);
            }
            if package.source.is_some() {
                component["purl"] = json!(format!("pkg:cargo/{name}@{version}"));
            }
            component
        })
        .collect();
    json!({
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": { "component": { "type": "application", "name": "bodyflight", "version": env!("CARGO_PKG_VERSION") } },
        "components": components,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn licences_and_sources_are_checked() {
        let package = |license: Option<&str>, source: Option<&str>| Package {
            name: "other".to_owned(),
            version: "1.0.0".to_owned(),
            license: license.map(str::to_owned),
            source: source.map(str::to_owned),
        };
        let allowed = ["MIT", "Apache-2.0 WITH LLVM-exception"]
            .map(str::to_owned)
            .into();
        let found =
            |packages: Vec<Package>| faults(&packages.into_iter().collect(), &allowed).len();
        let registry = Some("registry+one");
        assert_eq!(found(vec![package(None, None)]), 0, "our own");
        assert_eq!(found(vec![package(Some("MIT/Apache-2.0"), registry)]), 0);
        assert_eq!(
            found(vec![package(
                Some("GPL-3.0 OR Apache-2.0 WITH LLVM-exception"),
                registry
            )]),
            0
        );
        assert_eq!(
            found(vec![package(Some("MIT AND GPL-3.0-only"), registry)]),
            1
        );
        assert_eq!(found(vec![package(None, registry)]), 1);
        assert_eq!(found(vec![package(Some("MIT"), Some("git+somewhere"))]), 1);
        assert_eq!(
            found(vec![
                package(Some("MIT"), registry),
                package(Some("MIT"), Some("registry+two"))
            ]),
            1
        );
    }

    #[test]
    fn every_part_is_listed_once_with_its_licence() {
        let package = |name: &str, source: Option<&str>| Package {
            name: name.to_owned(),
            version: "1.0.0".to_owned(),
            license: Some("MIT/Apache-2.0".to_owned()),
            source: source.map(str::to_owned),
        };
        let packages = BTreeSet::from([
            package("own", None),
            package("other", Some("registry")),
            package("other", Some("registry")),
        ]);
        let bill = bill_of_materials(&packages);
        let components = bill["components"].as_array().map(Vec::len);
        assert_eq!(components, Some(2));
        assert_eq!(bill["components"][0]["purl"], "pkg:cargo/other@1.0.0");
        assert_eq!(
            bill["components"][0]["licenses"][0]["expression"],
            "MIT OR Apache-2.0"
        );
        assert!(bill["components"][1]["purl"].is_null());
    }
}
