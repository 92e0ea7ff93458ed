//! Every public entry of surefix-core is called in the image that links only without a panic.
//!
//! Reads core's sources for what is public and the image's sources for what it calls. A call counts
//! when it is written as a path, `Type::function` or `module::function`: a method call `x.len()` does
//! not tell whose `len` it is.

use std::collections::{BTreeSet, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

use syn::visit::Visit;

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn parse(file: &Path) -> syn::File {
    let text = fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    syn::parse_file(&text).unwrap_or_else(|e| panic!("{}: {e}", file.display()))
}

fn is_public(visibility: &syn::Visibility) -> bool {
    matches!(visibility, syn::Visibility::Public(_))
}

fn is_test_only(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("cfg")
            && matches!(&attribute.meta, syn::Meta::List(list) if list.tokens.to_string() == "test")
    })
}

/// The public functions of a crate, as `Type::function` or `module::function`.
#[derive(Default)]
struct Entries {
    found: BTreeSet<String>,
    /// Types that a user can name; inherent methods of others cannot be called.
    public_types: HashSet<String>,
}

impl Entries {
    /// Reads a module's items; `reachable` is `None` when all that is `pub` can be named, else the
    /// names a parent re-exports.
    fn module(
        &mut self,
        name: &str,
        folder: &Path,
        items: &[syn::Item],
        reachable: Option<&HashSet<String>>,
        types_only: bool,
    ) {
        let named =
            |ident: &syn::Ident| reachable.is_none_or(|set| set.contains(&ident.to_string()));
        for item in items {
            match item {
                syn::Item::Struct(x) if is_public(&x.vis) && named(&x.ident) => {
                    self.public_types.insert(x.ident.to_string());
                }
                syn::Item::Enum(x) if is_public(&x.vis) && named(&x.ident) => {
                    self.public_types.insert(x.ident.to_string());
                }
                syn::Item::Fn(x)
                    if !types_only
                        && is_public(&x.vis)
                        && named(&x.sig.ident)
                        && !is_test_only(&x.attrs) =>
                {
                    self.found.insert(format!("{name}::{}", x.sig.ident));
                }
                syn::Item::Impl(x) if !types_only && x.trait_.is_none() => self.inherent(x),
                syn::Item::Mod(x) if !is_test_only(&x.attrs) => {
                    self.submodule(name, folder, items, x, types_only);
                }
                _ => {}
            }
        }
    }

    fn inherent(&mut self, block: &syn::ItemImpl) {
        let syn::Type::Path(path) = &*block.self_ty else {
            return;
        };
        let Some(name) = path.path.segments.last().map(|s| s.ident.to_string()) else {
            return;
        };
        if is_test_only(&block.attrs) || !self.public_types.contains(&name) {
            return;
        }
        for item in &block.items {
            if let syn::ImplItem::Fn(x) = item
                && is_public(&x.vis)
                && !is_test_only(&x.attrs)
            {
                self.found.insert(format!("{name}::{}", x.sig.ident));
            }
        }
    }

    fn submodule(
        &mut self,
        around: &str,
        folder: &Path,
        siblings: &[syn::Item],
        module: &syn::ItemMod,
        types_only: bool,
    ) {
        let name = module.ident.to_string();
        let reexported = (!is_public(&module.vis)).then(|| reexports(siblings, &name));
        // What a private module re-exports is called through the module around it.
        let shown = if reexported.is_some() { around } else { &name };
        let below = folder.join(&name);
        let items = match &module.content {
            Some((_, items)) => items.clone(),
            None => {
                let flat = folder.join(format!("{name}.rs"));
                let nested = below.join("mod.rs");
                parse(if flat.exists() { &flat } else { &nested }).items
            }
        };
        self.module(shown, &below, &items, reexported.as_ref(), types_only);
    }
}

/// The names that `pub use` items take out of the private module `module`.
fn reexports(items: &[syn::Item], module: &str) -> HashSet<String> {
    fn leaves(tree: &syn::UseTree, out: &mut HashSet<String>) {
        match tree {
            syn::UseTree::Path(x) => leaves(&x.tree, out),
            syn::UseTree::Name(x) => drop(out.insert(x.ident.to_string())),
            syn::UseTree::Rename(x) => drop(out.insert(x.ident.to_string())),
            syn::UseTree::Group(x) => x.items.iter().for_each(|tree| leaves(tree, out)),
            syn::UseTree::Glob(_) => panic!("a glob re-export hides what is public"),
        }
    }
    let mut out = HashSet::new();
    for item in items {
        if let syn::Item::Use(x) = item
            && is_public(&x.vis)
            && let syn::UseTree::Path(path) = &x.tree
        {
            let from_self = path.ident == "self";
            match &*path.tree {
                syn::UseTree::Path(inner) if from_self && inner.ident == module => {
                    leaves(&inner.tree, &mut out);
                }
                tree if path.ident == module => leaves(tree, &mut out),
                _ => {}
            }
        }
    }
    out
}

/// Every path of two segments or more in a source, by its last two.
#[derive(Default)]
struct Calls(HashSet<String>);

impl<'ast> Visit<'ast> for Calls {
    fn visit_expr_path(&mut self, path: &'ast syn::ExprPath) {
        let names: Vec<_> = path
            .path
            .segments
            .iter()
            .map(|s| s.ident.to_string())
            .collect();
        if let [.., owner, function] = names.as_slice() {
            self.0.insert(format!("{owner}::{function}"));
        }
        syn::visit::visit_expr_path(self, path);
    }
}

fn public_entries() -> BTreeSet<String> {
    let folder = workspace().join("core/src");
    let items = parse(&folder.join("lib.rs")).items;
    let mut entries = Entries::default();
    // Types first: an impl block may stand in another file than its type.
    entries.module("surefix_core", &folder, &items, None, true);
    entries.module("surefix_core", &folder, &items, None, false);
    entries.found
}

fn calls_of_the_image() -> HashSet<String> {
    let folder = workspace().join("firmware/src/bin/no_panic");
    let mut calls = Calls::default();
    for entry in fs::read_dir(&folder).expect("the image has a folder") {
        let file = entry.expect("readable").path();
        calls.visit_file(&parse(&file));
    }
    calls.0
}

/// INT-006.
#[test]
fn every_public_entry_of_core_is_called_in_the_no_panic_image() {
    let entries = public_entries();
    assert!(
        entries.len() > 50 && entries.contains("GpsTime::nearest"),
        "the search for entries is broken: {} found",
        entries.len()
    );
    let calls = calls_of_the_image();
    let missing: Vec<_> = entries.iter().filter(|e| !calls.contains(*e)).collect();
    assert!(
        missing.is_empty(),
        "{} of {} public functions of surefix-core are not called in firmware/src/bin/no_panic; \
         call each there as Type::function or module::function:\n{missing:#?}",
        missing.len(),
        entries.len(),
    );
}
