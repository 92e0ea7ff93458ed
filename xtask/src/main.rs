//! Set-up and checks of the surefix workspace.

fn main() {
    eprintln!("usage: cargo xtask setup|demo|test|bench");
    std::process::exit(2);
}
